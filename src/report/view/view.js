// The view of a page: reads its data, listens to pointer, keys and controls, and asks gl.js to draw.
"use strict";

/** Tells LiDARs apart, also for the colour-blind (Okabe and Ito); as in the drawings. */
const LIDARS = LIDAR_COLOURS;
const CLASSES = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#7b5c3e", "#f0e442"];
/** Viridis: from little to much on a dark page, the other way round on a light one. */
const RAMP = ["#440154", "#3b528b", "#21918c", "#5ec962", "#fde725"];
/** Metres at which walls are cut, so that streets can be looked into from above. */
const CUT = 2.2;
const [MORE, LESS] = ["#0072b2", "#d55e00"];
/** Voxels that one, two, three and more LiDARs see. */
const REDUNDANCY = ["#d55e00", "#e5c100", "#0072b2"];

const rgb = (hex) => [1, 3, 5].map((at) => parseInt(hex.slice(at, at + 2), 16) / 255);
/** LiDARs in a mask, three for more. */
const upTo3 = (mask) => {
  let count = 0;
  for (let rest = mask; rest && count < 3; rest &= rest - 1) count += 1;
  return count;
};
const clamp = (value, low, high) => Math.min(Math.max(value, low), high);
const by = (id) => document.getElementById(id);

/** The header of a scene with its arrays in place of where they lie. */
function unpack(scene) {
  const part = (name) => document.querySelectorAll(`script.${name}`)[scene].textContent;
  const text = atob(part("view-bytes").trim());
  const bytes = Uint8Array.from(text, (letter) => letter.charCodeAt(0));
  const kinds = { u8: Uint8Array, u16: Uint16Array, u32: Uint32Array, f32: Float32Array };
  const array = ([kind, from, length]) => new kinds[kind](bytes.buffer, from, length);
  const data = JSON.parse(part("view-data"));
  data.poses = array(data.poses);
  for (const shape of data.shapes) {
    shape.corners = array(shape.corners);
    shape.classes = array(shape.classes);
  }
  const voxel = Object.fromEntries(Object.entries(data.voxels).map(([key, at]) => [key, array(at)]));
  const [, ny, nz] = data.roi.shape;
  data.cells = new Uint16Array(3 * voxel.index.length);
  voxel.index.forEach((index, k) => {
    data.cells.set([Math.floor(index / nz / ny), Math.floor(index / nz) % ny, index % nz], 3 * k);
  });
  data.voxel = voxel;
  data.voxels = voxel.index.length;
  data.ends = array(data.beams.ends);
  data.counts = array(data.beams.counts);
  data.reach = data.beams.reach;
  return data;
}

/** Matrix of a camera that looks from `eye` to `target`, column-major, and what it is made of. */
function camera(state, aspect) {
  const distance = 46 / state.zoom;
  const [cy, sy, cp, sp] = [Math.cos(state.yaw), Math.sin(state.yaw), Math.cos(state.pitch), Math.sin(state.pitch)];
  const back = [cy * cp, sy * cp, sp];
  const [right, up] = [[-sy, cy, 0], [-cy * sp, -sy * sp, cp]];
  const eye = state.target.map((t, k) => t + distance * back[k]);
  const focus = 1 / Math.tan(0.36);
  const [fx, fy] = aspect > 1 ? [focus / aspect, focus] : [focus, focus * aspect];
  const [near, far] = [distance / 60, distance * 4 + 400];
  const dot = (a) => -(a[0] * eye[0] + a[1] * eye[1] + a[2] * eye[2]);
  const [a, b] = [(far + near) / (near - far), (2 * far * near) / (near - far)];
  const columns = [0, 1, 2].map((k) => [fx * right[k], fy * up[k], a * back[k], -back[k]]);
  columns.push([fx * dot(right), fy * dot(up), a * dot(back) + b, -dot(back)]);
  return { view: new Float32Array(columns.flat()), eye, right, up, distance };
}

function start() {
  const canvas = by("canvas");
  /** Scenes that were shown: what they hold, and what draws it. */
  const known = new Map();
  function scene(number) {
    if (!known.has(number)) {
      const data = unpack(number);
      known.set(number, { data, paint: painter(canvas, data) });
    }
    return known.get(number);
  }
  let shown = 0;
  let { data, paint } = scene(shown);
  if (!paint) {
    document.body.dataset.state = "fallback";
    by("view-fallback").hidden = false;
    const maps = document.querySelectorAll("#map .information");
    if (maps.length === 0) return;
    // Other scenes and the LiDARs of a column keep their maps, and the first of them the meaning.
    const meaning = document.querySelector("#map .meaning");
    by("view-fallback").append(meaning.cloneNode(true), maps[0]);
    if (maps.length === 1) meaning.remove();
    by("map").hidden = !document.querySelector("#map figure");
    return;
  }
  by("view").hidden = false;
  const dark = window.matchMedia("(prefers-color-scheme: dark)");
  const home = () => ({ yaw: -2.5, pitch: 0.62, zoom: 1, target: [4, 0, 0] });
  let state = home();
  const controls = by("controls").elements;
  const choice = () => ({
    colour: controls.colour.value,
    baseline: Number(controls.baseline?.value ?? 0),
    lidar: controls.lidar.value,
    frame: Number(controls.frame.value),
  });

  /** Colour and size of a voxel in the way chosen: `null` is what nothing is to be said of. */
  function looker({ colour, baseline, lidar, frame }) {
    // Voxels come with most information first.
    const { class: kinds, masks, shares } = data.voxel;
    const seen = masks.subarray(frame * data.voxels, (frame + 1) * data.voxels);
    const ours = LIDARS.map(rgb);
    const several = rgb(dark.matches ? "#e8edf2" : "#1b2a3a");
    const ramp = (dark.matches ? RAMP : [...RAMP].reverse()).map(rgb);
    const along = (share) => {
      const at = clamp(share, 0, 1) * (ramp.length - 1);
      const step = Math.min(Math.floor(at), ramp.length - 2);
      return ramp[step].map((low, k) => low + (ramp[step + 1][k] - low) * (at - step));
    };
    const steps = Array.from({ length: 256 }, (_, k) => along(k / 255));
    const inks = REDUNDANCY.map(rgb);
    const kind = new Map(topClasses().map((name, k) => [name, rgb(CLASSES[k])]));
    const one = lidar === "none" || lidar === "all" ? -1 : Number(lidar);
    const of = {
      information: (k) => (seen[k] ? steps[Math.floor((255 * (data.voxels - 1 - k)) / data.voxels)] : null),
      class: (k) => kind.get(kinds[k]) ?? null,
      seen(k) {
        if (one >= 0) return (seen[k] >> one) & 1 ? ours[one % ours.length] : null;
        if (seen[k] === 0) return null;
        return seen[k] & (seen[k] - 1) ? several : ours[(31 - Math.clz32(seen[k])) % ours.length];
      },
      redundancy: (k) => (seen[k] ? inks[upTo3(seen[k]) - 1] : null),
      difference(k) {
        const more = shares[k] - shares[(baseline + 1) * data.voxels + k];
        return Math.abs(more) < 26 ? null : rgb(more > 0 ? MORE : LESS);
      },
    };
    return of[colour];
  }

  /** The classes with most information among the voxels drawn, as many as there are colours. */
  function topClasses() {
    const sums = new Map();
    data.voxel.class.forEach((kind, k) => sums.set(kind, (sums.get(kind) ?? 0) + data.voxel.worth[k]));
    return [...sums].sort((a, b) => b[1] - a[1]).slice(0, CLASSES.length).map(([kind]) => kind);
  }

  function colourVoxels() {
    const look = looker(choice());
    const unseen = dark.matches ? [84, 96, 108] : [178, 187, 196];
    const bytes = new Uint8Array(4 * data.voxels);
    for (let k = 0; k < data.voxels; k++) {
      const colour = look(k);
      const size = 120 + 130 * Math.sqrt(data.voxel.worth[k] / 255);
      bytes.set(colour ? colour.map((c) => 255 * c) : unseen, 4 * k);
      bytes[4 * k + 3] = colour ? size : 0.5 * size;
    }
    paint.colour(bytes);
    document.body.dataset.coloured = String(bytes.reduce((sum, byte) => (31 * sum + byte) % 1000003, 7));
  }

  /** Entries of the legend for redundancy, with the number of voxels drawn that so many LiDARs see in the frame. */
  function redundancy(frame, grey) {
    const by = [0, 0, 0, 0];
    data.voxel.masks.subarray(frame * data.voxels, (frame + 1) * data.voxels).forEach((mask) => { by[upTo3(mask)] += 1; });
    const told = (count) => `${count} (${((100 * count) / Math.max(data.voxels, 1)).toFixed(1)} %)`;
    const names = ["1 LiDAR", "2 LiDARs", "3 or more LiDARs"].slice(0, data.lidars.length);
    const seen = names.map((name, k) => [REDUNDANCY[k], `seen by ${name}: ${told(by[k + 1])}`]);
    return [[grey, `seen by none: ${told(by[0])}`], ...seen];
  }

  /** Meaning of the colours, in words. */
  function legend() {
    const { colour, baseline, lidar, frame } = choice();
    const many = data.lidars.length > 1;
    const ramp = (dark.matches ? RAMP : [...RAMP].reverse()).join(",");
    const grey = [dark.matches ? "#54606c" : "#b2bbc4", colour === "class" ? "other classes" : "not seen"];
    const names = controls.baseline ? [...controls.baseline.options].map((option) => option.text) : [];
    const words = {
      information: [[`linear-gradient(90deg,${ramp})`, "seen: from least to most information", true], grey],
      class: [...topClasses().map((kind, k) => [CLASSES[k], data.classes[kind] ?? "?"]), grey],
      seen: [
        ...data.lidars.map((_, k) => [LIDARS[k % LIDARS.length], many ? `only LiDAR ${k}` : "seen"]),
        ...(many ? [[dark.matches ? "#e8edf2" : "#1b2a3a", "several"]] : []),
        grey,
      ],
      redundancy: redundancy(frame, grey[0]),
      difference: [[MORE, `seen more often than by ${names[baseline]}`], [LESS, "seen less often"], [grey[0], "as often, within 10 % of the frames"]],
    }[colour];
    const one = colour === "seen" && !["none", "all"].includes(lidar);
    const shown = one ? [[LIDARS[lidar % LIDARS.length], `seen by LiDAR ${lidar}`], grey] : words;
    by("legend").replaceChildren(...shown.map(([paper, text, wide]) => {
      const entry = document.createElement("li");
      const swatch = document.createElement("span");
      swatch.style.background = paper;
      if (wide) swatch.className = "ramp";
      entry.append(swatch, text);
      return entry;
    }));
  }

  /** From the LiDARs to where their beams end, as pairs of corners. */
  function beamsOf({ lidar, frame }) {
    const reach = data.reach;
    const count = data.lidars.length;
    let from = data.counts.subarray(0, frame * count).reduce((sum, n) => sum + n, 0);
    return data.lidars.flatMap((at, k) => {
      const ends = data.ends.subarray(3 * from, 3 * (from + data.counts[frame * count + k]));
      from += data.counts[frame * count + k];
      if (lidar !== "all" && Number(lidar) !== k) return [];
      const origin = at.map((v) => clamp(Math.round(((v + reach) / (2 * reach)) * 65535), 0, 65535));
      const corners = new Uint16Array(2 * ends.length);
      for (let beam = 0; beam < ends.length; beam += 3) {
        corners.set(origin, 2 * beam);
        corners.set(ends.subarray(beam, beam + 3), 2 * beam + 3);
      }
      return [{ corners, ink: rgb(LIDARS[k % LIDARS.length]) }];
    });
  }

  /** Shades of surfaces: ground, buildings and plants stay behind the voxels. */
  function tints() {
    const shade = (share) => {
      const [low, high] = dark.matches ? [rgb("#262f38"), rgb("#45525f")] : [rgb("#ccd4db"), rgb("#f3f5f7")];
      return low.map((v, k) => v + (high[k] - v) * share);
    };
    const ground = ["road", "road_line", "sidewalk", "ground", "terrain", "parking"];
    const of = (name) => shade(ground.includes(name) ? 1 : name === "building" || name === "wall" ? 0.5 : 0.15);
    const fill = (colour) => new Float32Array(Array.from({ length: 64 }, () => rgb(colour)).flat());
    const world = new Float32Array(Array.from({ length: 64 }, (_, k) => of(data.classes[k])).flat());
    return { world, actors: fill(dark.matches ? "#7d8b99" : "#93a1af"), body: fill(dark.matches ? "#c3ccd5" : "#3b4c5d") };
  }

  let waiting = false;
  let first = true;
  function draw() {
    waiting = false;
    const ratio = Math.min(window.devicePixelRatio || 1, 2);
    const [width, height] = [canvas.clientWidth, canvas.clientHeight];
    if (canvas.width !== Math.round(width * ratio)) canvas.width = Math.round(width * ratio);
    if (canvas.height !== Math.round(height * ratio)) canvas.height = Math.round(height * ratio);
    const look = camera(state, width / height);
    const now = choice();
    const triangles = paint.draw({
      view: look.view, eye: look.eye, frame: now.frame, tints: tints(), beams: beamsOf(now),
      paper: rgb(dark.matches ? "#161c22" : "#ffffff"),
      top: controls.whole.checked ? 1e9 : CUT, surfaces: controls.surfaces.checked, voxels: controls.voxels.checked,
    });
    data.lidars.forEach((at, k) => {
      const [x, y, , w] = [0, 1, 2, 3].map((row) =>
        look.view[row] * at[0] + look.view[4 + row] * at[1] + look.view[8 + row] * at[2] + look.view[12 + row]);
      const dot = by("lidars").children[k];
      dot.hidden = w <= 0 || Math.abs(x) > w || Math.abs(y) > w;
dot.style.left = `${50 * (x / w + 1)}%`;
      dot.style.top = `${50 * (1 - y / w)}%`;
    });
    const told = document.body.dataset;
    told.triangles = triangles;
    told.voxels = controls.voxels.checked ? data.voxels : 0;
    told.beams = beamsOf(now).reduce((sum, { corners }) => sum + corners.length / 6, 0);
    if (first) told.painted = paint.painted();
    first = false;
    told.state = "drawn";
  }
  function redraw() {
    if (!waiting) requestAnimationFrame(draw);
    waiting = true;
  }
  /** Takes the scene that is chosen, whose frames are its own. */
  function chosen() {
    const number = Number(controls.scene?.value ?? 0);
    if (number === shown) return;
    shown = number;
    ({ data, paint } = scene(number));
    controls.frame.max = data.frames.length - 1;
    controls.frame.disabled = data.frames.length < 2;
    document.querySelectorAll(".left-out").forEach((words, k) => { words.hidden = k !== number; });
  }
  function changed() {
    chosen();
    by("frame-number").textContent = `${data.frames[choice().frame]}`;
    const baseline = by("baseline-choice");
    if (baseline) baseline.hidden = choice().colour !== "difference";
    colourVoxels();
    legend();
    redraw();
  }
  function turn(yaw, pitch) {
    state.yaw += yaw;
    state.pitch = clamp(state.pitch + pitch, -0.2, 1.55);
    redraw();
  }
  function zoom(factor) {
    state.zoom = clamp(state.zoom * factor, 0.15, 25);
    redraw();
  }
  function move(x, y) {
    const { right, up, distance } = camera(state, 1);
    const metres = (distance * 0.76) / canvas.clientHeight;
    state.target = state.target.map((t, k) => clamp(t + metres * (y * up[k] - x * right[k]), -500, 500));
    redraw();
  }

  const pointers = new Map();
  canvas.addEventListener("pointerdown", (event) => {
    canvas.setPointerCapture(event.pointerId);
    canvas.focus({ preventScroll: true });
    pointers.set(event.pointerId, [event.clientX, event.clientY]);
  });
  for (const ended of ["pointerup", "pointercancel"]) {
    canvas.addEventListener(ended, (event) => pointers.delete(event.pointerId));
  }
  canvas.addEventListener("pointermove", (event) => {
    const was = pointers.get(event.pointerId);
    if (!was) return;
    const [x, y] = [event.clientX - was[0], event.clientY - was[1]];
    const other = [...pointers].find(([id]) => id !== event.pointerId)?.[1];
    pointers.set(event.pointerId, [event.clientX, event.clientY]);
    if (other) {
      const apart = (at) => Math.hypot(at[0] - other[0], at[1] - other[1]) || 1;
      zoom(apart([event.clientX, event.clientY]) / apart(was));
      move(x / 2, y / 2);
    } else if (event.shiftKey || event.buttons === 2 || event.buttons === 4) move(x, y);
    else turn(-0.007 * x, 0.007 * y);
  });
  canvas.addEventListener("contextmenu", (event) => event.preventDefault());
  canvas.addEventListener("wheel", (event) => {
    // A page that scrolls by is not to zoom; who has clicked the picture wants to.
    if (document.activeElement !== canvas && !event.ctrlKey) return;
    event.preventDefault();
    zoom(Math.exp(-0.0015 * event.deltaY));
  }, { passive: false });
  const reset = () => { state = home(); redraw(); };
  canvas.addEventListener("keydown", (event) => {
    const [x, y] = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[event.key] ?? [0, 0];
    if (x || y) event.shiftKey ? move(-40 * x, 40 * y) : turn(0.1 * x, 0.1 * y);
    else if (event.key === "+" || event.key === "=") zoom(1.25);
    else if (event.key === "-") zoom(0.8);
    else if (event.key === "0" || event.key === "Home") reset();
    else return;
    event.preventDefault();
  });
  by("zoom-in").addEventListener("click", () => zoom(1.25));
  by("zoom-out").addEventListener("click", () => zoom(0.8));
  by("reset").addEventListener("click", reset);
  by("controls").addEventListener("input", changed);
  by("controls").addEventListener("submit", (event) => event.preventDefault());
  dark.addEventListener("change", changed);
  new ResizeObserver(redraw).observe(canvas);

  /** Takes camera and controls from the address, as #yaw=1.2&frame=3&colour=class. */
  function fromAddress() {
    const asked = new URLSearchParams(location.hash.slice(1));
    // Whether a frame is there depends on the scene.
    if (asked.has("scene") && controls.scene) controls.scene.value = asked.get("scene");
    chosen();
    for (const [key, value] of asked) {
      if (["yaw", "pitch", "zoom"].includes(key) && Number.isFinite(Number(value))) state[key] = Number(value);
      else if (["colour", "lidar", "frame", "baseline"].includes(key) && controls[key]) controls[key].value = value;
    }
    turn(0, 0);
    zoom(1);
    changed();
  }
  window.addEventListener("hashchange", fromAddress);
  fromAddress();
}

window.addEventListener("error", () => { document.body.dataset.state = "failed"; });
start();
