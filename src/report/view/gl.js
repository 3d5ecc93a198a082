// Draws things, voxels and beams with WebGL2. Knows no control and no page.
"use strict";

const MESH_VERTEX = `#version 300 es
uniform mat4 view, pose;
uniform vec3 low, size, tints[64];
in vec3 corner;
in uint kind;
out vec3 at, tint;
void main() {
  vec4 place = pose * vec4(low + size * corner, 1.0);
  at = place.xyz;
  tint = tints[int(kind) % 64];
  gl_Position = view * place;
}`;

// The normal is that of the plane through neighbouring pixels, so that corners need none.
const MESH_FRAGMENT = `#version 300 es
precision highp float;
uniform float top;
in vec3 at, tint;
out vec4 colour;
void main() {
  if (at.z > top) discard;
  vec3 normal = normalize(cross(dFdx(at), dFdy(at)));
  float light = 0.74 + 0.26 * abs(dot(normal, normalize(vec3(0.35, 0.5, 0.8))));
  colour = vec4(tint * light, 1.0);
}`;

// Three faces of a cube look at the eye: 18 corners a voxel.
const VOXEL_VERTEX = `#version 300 es
uniform mat4 view;
uniform vec3 low, edge, eye;
in vec3 cell;
in vec4 look;
out vec3 tint;
void main() {
  vec3 middle = low + edge * (cell + 0.5);
  vec3 side = vec3(greaterThan(eye, middle)) * 2.0 - 1.0;
  int axis = gl_VertexID / 6, corner = gl_VertexID % 6;
  vec2 flat_ = vec2(corner == 1 || corner == 2 || corner == 4 ? 1.0 : -1.0,
                    corner == 2 || corner == 4 || corner == 5 ? 1.0 : -1.0);
  vec3 face = axis == 0 ? vec3(side.x, flat_) : axis == 1 ? vec3(flat_.x, side.y, flat_.y)
                                              : vec3(flat_, side.z);
  tint = look.rgb * (axis == 2 ? 1.0 : axis == 1 ? 0.9 : 0.82);
  gl_Position = view * vec4(middle + 0.5 * look.a * edge * face, 1.0);
}`;

const LINE_VERTEX = `#version 300 es
uniform mat4 view;
uniform float reach, dots;
in vec3 end;
void main() {
  gl_Position = view * vec4((end * 2.0 - 1.0) * reach, 1.0);
  gl_PointSize = dots;
}`;

const PLAIN_FRAGMENT = `#version 300 es
precision highp float;
uniform vec4 ink;
out vec4 colour;
void main() { colour = ink; }`;

const TINT_FRAGMENT = `#version 300 es
precision highp float;
in vec3 tint;
out vec4 colour;
void main() { colour = vec4(tint, 1.0); }`;

/** A program with its uniforms and attributes by name. */
function program(gl, vertex, fragment) {
  const made = gl.createProgram();
  for (const [kind, text] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, text);
    gl.compileShader(shader);
    gl.attachShader(made, shader);
  }
  gl.linkProgram(made);
  if (!gl.getProgramParameter(made, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(made));
  const uniform = (name) => gl.getUniformLocation(made, name);
  const attribute = (name) => gl.getAttribLocation(made, name);
  return { made, uniform, attribute };
}

/** A buffer of values. */
function buffer(gl, values) {
  const made = gl.createBuffer();
  gl.bindBuffer(gl.ARRAY_BUFFER, made);
  gl.bufferData(gl.ARRAY_BUFFER, values, gl.STATIC_DRAW);
  return made;
}

/** Column-major 4×4 matrix of twelve numbers in three rows. */
function matrix(rows) {
  const [a, b, c, x, d, e, f, y, g, h, i, z] = rows;
  return new Float32Array([a, d, g, 0, b, e, h, 0, c, f, i, 0, x, y, z, 1]);
}

/** Painter that draws `data` on a canvas; `null` without WebGL2. */
function painter(canvas, data) {
  const gl = canvas.getContext("webgl2", { antialias: true, preserveDrawingBuffer: true });
  if (!gl) return null;
  const mesh = program(gl, MESH_VERTEX, MESH_FRAGMENT);
  const cubes = program(gl, VOXEL_VERTEX, TINT_FRAGMENT);
  const lines = program(gl, LINE_VERTEX, PLAIN_FRAGMENT);

  const shapes = data.shapes.map((shape) => {
    const array = gl.createVertexArray();
    gl.bindVertexArray(array);
    buffer(gl, shape.corners);
    gl.enableVertexAttribArray(mesh.attribute("corner"));
    gl.vertexAttribPointer(mesh.attribute("corner"), 3, gl.UNSIGNED_SHORT, true, 0, 0);
    const kinds = new Uint8Array(shape.classes.length * 3);
    shape.classes.forEach((kind, face) => kinds.fill(kind, 3 * face, 3 * face + 3));
    buffer(gl, kinds);
    gl.enableVertexAttribArray(mesh.attribute("kind"));
    gl.vertexAttribIPointer(mesh.attribute("kind"), 1, gl.UNSIGNED_BYTE, 0, 0);
    return { array, corners: shape.corners.length / 3, low: shape.min, size: shape.size };
  });

  const voxels = gl.createVertexArray();
  gl.bindVertexArray(voxels);
  buffer(gl, data.cells);
  gl.enableVertexAttribArray(cubes.attribute("cell"));
  gl.vertexAttribPointer(cubes.attribute("cell"), 3, gl.UNSIGNED_SHORT, false, 0, 0);
  gl.vertexAttribDivisor(cubes.attribute("cell"), 1);
  const looks = buffer(gl, new Uint8Array(4 * data.voxels));
  gl.enableVertexAttribArray(cubes.attribute("look"));
  gl.vertexAttribPointer(cubes.attribute("look"), 4, gl.UNSIGNED_BYTE, true, 0, 0);
  gl.vertexAttribDivisor(cubes.attribute("look"), 1);

  const beams = gl.createVertexArray();
  const ends = gl.createBuffer();
  gl.bindVertexArray(beams);
  gl.bindBuffer(gl.ARRAY_BUFFER, ends);
  gl.enableVertexAttribArray(lines.attribute("end"));
  gl.vertexAttribPointer(lines.attribute("end"), 3, gl.UNSIGNED_SHORT, true, 0, 0);

  function drawThings({ view, frame, tints, top }) {
    gl.useProgram(mesh.made);
    gl.uniformMatrix4fv(mesh.uniform("view"), false, view);
    let triangles = 0;
    data.shape_of.forEach((which, thing) => {
      const shape = shapes[which];
      if (shape.corners === 0) return;
      const body = thing >= data.own;
      const first = 12 * (frame * data.shape_of.length + thing);
      gl.uniform3fv(mesh.uniform("tints"), body ? tints.body : thing === 0 ? tints.world : tints.actors);
      gl.uniform1f(mesh.uniform("top"), thing === 0 ? top : 1e9);
      gl.uniformMatrix4fv(mesh.uniform("pose"), false, matrix(data.poses.subarray(first, first + 12)));
      gl.uniform3fv(mesh.uniform("low"), shape.low);
      gl.uniform3fv(mesh.uniform("size"), shape.size);
      gl.bindVertexArray(shape.array);
      gl.drawArrays(gl.TRIANGLES, 0, shape.corners);
      triangles += shape.corners / 3;
    });
    return triangles;
  }

  function drawVoxels({ view, eye }) {
    gl.useProgram(cubes.made);
    gl.uniformMatrix4fv(cubes.uniform("view"), false, view);
    gl.uniform3fv(cubes.uniform("eye"), eye);
    gl.uniform3fv(cubes.uniform("low"), data.roi.min);
    gl.uniform3fv(cubes.uniform("edge"), data.roi.voxel);
    gl.bindVertexArray(voxels);
    gl.drawArraysInstanced(gl.TRIANGLES, 0, 18, data.voxels);
  }

  function drawBeams({ view, beams: shown }) {
    gl.useProgram(lines.made);
    gl.uniformMatrix4fv(lines.uniform("view"), false, view);
    gl.uniform1f(lines.uniform("reach"), data.reach);
    gl.bindVertexArray(beams);
    gl.bindBuffer(gl.ARRAY_BUFFER, ends);
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);
    for (const { corners, ink } of shown) {
      gl.bufferData(gl.ARRAY_BUFFER, corners, gl.DYNAMIC_DRAW);
      gl.depthMask(false);
      gl.uniform1f(lines.uniform("dots"), 1);
      gl.uniform4f(lines.uniform("ink"), ...ink, 0.3);
      gl.drawArrays(gl.LINES, 0, corners.length / 3);
      gl.depthMask(true);
      gl.uniform1f(lines.uniform("dots"), 3 * (window.devicePixelRatio || 1));
      gl.uniform4f(lines.uniform("ink"), ...ink, 1);
      gl.drawArrays(gl.POINTS, 0, corners.length / 3);
    }
    gl.disable(gl.BLEND);
  }

  return {
    /** Colours and sizes of the voxels, four bytes each. */
    colour(bytes) {
      gl.bindBuffer(gl.ARRAY_BUFFER, looks);
      gl.bufferSubData(gl.ARRAY_BUFFER, 0, bytes);
    },
    /** Draws all, and tells how many triangles of things that were. */
    draw(scene) {
      gl.viewport(0, 0, canvas.width, canvas.height);
      gl.clearColor(...scene.paper, 1);
      gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
      gl.enable(gl.DEPTH_TEST);
      const triangles = scene.surfaces ? drawThings(scene) : 0;
      if (scene.voxels) drawVoxels(scene);
      drawBeams(scene);
      return triangles;
    },
    /** Pixels that are not as the upper left one. */
    painted() {
      const bytes = new Uint8Array(4 * canvas.width * canvas.height);
      gl.readPixels(0, 0, canvas.width, canvas.height, gl.RGBA, gl.UNSIGNED_BYTE, bytes);
      const pixels = new Uint32Array(bytes.buffer);
      const empty = pixels[pixels.length - canvas.width];
      return pixels.reduce((count, pixel) => count + (pixel !== empty ? 1 : 0), 0);
    },
  };
}
