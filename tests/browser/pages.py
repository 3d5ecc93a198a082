"""Opens the pages in a folder in Chromium: what they draw, what each control changes, what axe finds."""

import base64
import io
import json
import re
import sys
from pathlib import Path

from PIL import Image
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Page, sync_playwright

CHROMIUM = "/usr/bin/chromium"
FLAGS = ["--no-sandbox", "--disable-background-networking"]
WIDE, PHONE = {"width": 1280, "height": 800}, {"width": 390, "height": 800}
MOST_BYTES = 4_000_000
# WebGPU on the CPU.
GPU_FLAGS = ["--enable-unsafe-webgpu", "--enable-features=Vulkan", "--use-webgpu-adapter=swiftshader"]
COMPILE = """async ([name, code]) => {
    const adapter = await navigator.gpu?.requestAdapter();
    if (!adapter) return "this Chromium has no WebGPU";
    const device = await adapter.requestDevice();
    const module = device.createShaderModule({code});
    const said = (await module.getCompilationInfo()).messages.map((one) => `line ${one.lineNum}: ${one.message}`);
    const compute = {module, entryPoint: name};
    try { await device.createComputePipelineAsync({layout: "auto", compute}); } catch (error) { said.push(error.message); }
    return said.join("; ");
}"""
# Runs the dispatches of a batch and returns, for each buffer that kernels make, how many words differ from its file.
RUN = """async ([batch, files, sources]) => {
    const device = await (await navigator.gpu.requestAdapter()).requestDevice();
    const said = [];
    device.addEventListener("uncapturederror", (event) => said.push(event.error.message));
    const {STORAGE, UNIFORM, COPY_SRC, COPY_DST, MAP_READ} = GPUBufferUsage;
    const wanted = files.map((file) => Uint8Array.from(atob(file), (letter) => letter.charCodeAt(0)));
    const buffers = batch.buffers.map(({bytes, made}, number) => {
        const buffer = device.createBuffer({size: bytes, usage: STORAGE | UNIFORM | COPY_SRC | COPY_DST});
        if (!made) device.queue.writeBuffer(buffer, 0, wanted[number]);
        return buffer;
    });
    const encoder = device.createCommandEncoder();
    for (const {kernel, buffers: bound, groups} of batch.dispatches) {
        const module = device.createShaderModule({code: sources[kernel]});
        const pipeline = device.createComputePipeline({layout: "auto", compute: {module, entryPoint: kernel}});
        const entries = bound.map((number, binding) => ({binding, resource: {buffer: buffers[number]}}));
        const pass = encoder.beginComputePass();
        pass.setPipeline(pipeline);
        pass.setBindGroup(0, device.createBindGroup({layout: pipeline.getBindGroupLayout(0), entries}));
        pass.dispatchWorkgroups(...groups);
        pass.end();
    }
    const copies = buffers.map((buffer) => {
        const copy = device.createBuffer({size: buffer.size, usage: MAP_READ | COPY_DST});
        encoder.copyBufferToBuffer(buffer, 0, copy, 0, buffer.size);
        return copy;
    });
    device.queue.submit([encoder.finish()]);
    const differing = [];
    for (const [number, copy] of copies.entries()) {
        if (!batch.buffers[number].made) continue;
        await copy.mapAsync(GPUMapMode.READ);
        const [got, want] = [new Uint32Array(copy.getMappedRange()), new Uint32Array(wanted[number].buffer)];
        differing.push(got.filter((word, place) => word !== want[place]).length);
    }
    return {differing, said};
}"""
# Chromium tells of its own software driver when pixels are read.
HARMLESS = "GPU stall due to ReadPixels"


def check(right: bool, wrong: object) -> None:
    if not right:
        raise SystemExit(f"tests/browser: {wrong}")


def opened(browser, file: Path, address: str = "", **settings) -> Page:
    """A page that has drawn; whatever it says on the console is an error."""
    page = browser.new_context(**settings).new_page()
    page.on("pageerror", lambda error: check(False, f"{file.name}: {error}"))
    page.on("console", lambda line: check(HARMLESS in line.text, f"{file.name}: {line.type}: {line.text}"))
    page.on("request", lambda sent: check(sent.url.startswith("file://"), f"{file.name} loads {sent.url}"))
    page.goto(f"file://{file}{address}")
    page.wait_for_function("document.body.dataset.state === 'drawn'", timeout=20_000)
    return page


def told(page: Page) -> dict:
    """Values that the page tells of its picture, once it is drawn anew."""
    page.evaluate("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")
    return page.evaluate("({...document.body.dataset})")


def picture(page: Page) -> str:
    """Picture on the canvas."""
    told(page)
    return page.evaluate("document.getElementById('canvas').toDataURL()")


def changes(page: Page, what: str, act) -> None:
    """Fails unless an act changes the picture."""
    before = picture(page)
    act()
    check(picture(page) != before, f"{what} changes nothing in the picture")


def keep(page: Page, name: str) -> None:
    """A small picture for the docs."""
    shot = Image.open(io.BytesIO(page.screenshot())).convert("RGB")
    shot.quantize(160, method=Image.Quantize.FASTOCTREE, dither=Image.Dither.NONE).save(f"docs/report/{name}.png", optimize=True)


def draws(page: Page, triangles: int) -> None:
    state = told(page)
    check(int(state["triangles"]) == triangles, f"{state['triangles']} triangles are drawn, the scene has {triangles}")
    size = page.evaluate("document.getElementById('canvas').width * document.getElementById('canvas').height")
    share = int(state["painted"]) / size
    check(0.1 < share, f"only {share:.0%} of the canvas is painted")
    check(int(state["voxels"]) > 1000, f"only {state['voxels']} voxels")


def moves(page: Page) -> None:
    """Pointer, wheel, keys and buttons move the camera; Reset brings the first picture back."""
    first = picture(page)
    box = page.locator("#canvas").bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2

    def drag(key: str | None = None) -> None:
        if key:
            page.keyboard.down(key)
        page.mouse.move(x, y)
        page.mouse.down()
        page.mouse.move(x + 90, y + 30)
        page.mouse.up()
        if key:
            page.keyboard.up(key)

    changes(page, "dragging", drag)
    changes(page, "dragging with Shift", lambda: drag("Shift"))
    changes(page, "the wheel", lambda: page.mouse.wheel(0, 300))
    page.locator("#reset").click()
    check(picture(page) == first, "Reset does not bring the first picture back")
    page.locator("#canvas").focus()
    page.keyboard.press("Home")
    ring = page.evaluate("getComputedStyle(document.activeElement).outlineWidth")
    check(ring == "3px", "nothing shows that the picture has the focus of the keyboard")
    for key in ["ArrowLeft", "ArrowRight", "ArrowUp", "ArrowDown", "+", "-", "Shift+ArrowLeft"]:
        changes(page, f"the key {key}", lambda key=key: page.keyboard.press(key))
    page.keyboard.press("0")
    check(picture(page) == first, "the key 0 does not bring the first picture back")
    for button in ["#zoom-in", "#zoom-out"]:
        changes(page, button, page.locator(button).click)
    page.locator("#reset").click()


def touches(page: Page) -> None:
    """One finger turns the view, two that part zoom in."""
    # Requirements may stand before the picture.
    page.locator("#canvas").scroll_into_view_if_needed()
    box = page.locator("#canvas").bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    session = page.context.new_cdp_session(page)

    def gesture(steps: list[list[tuple[float, float]]]) -> None:
        for number, fingers in enumerate(steps):
            points = [{"x": u, "y": v, "id": finger} for finger, (u, v) in enumerate(fingers)]
            kind = "touchStart" if number == 0 else "touchMove"
            session.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})
        session.send("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})

    changes(page, "a finger", lambda: gesture([[(x, y)], [(x + 40, y)], [(x + 80, y)]]))
    parted = [[(x - d, y), (x + d, y)] for d in (20, 40, 60)]
    changes(page, "two fingers", lambda: gesture(parted))


def controls(page: Page) -> None:
    """Each control does what it says, and has a way back."""
    colour, legend = page.locator("[name=colour]"), page.locator("#legend")
    check(not page.locator("[name=baseline]").is_visible(), "a baseline is asked for without a difference")
    texts = {legend.inner_text()}
    for value in ["class", "seen", "redundancy", "difference"]:
        changes(page, f"colour by {value}", lambda value=value: colour.select_option(value))
        texts.add(legend.inner_text())
        if value == "redundancy":
            counts = [int(count) for count in re.findall(r": (\d+) \(", legend.inner_text())]
            voxels = int(told(page)["voxels"])
            check(len(counts) == 4 and sum(counts) == voxels, f"{counts} are not the {voxels} voxels drawn")
    check(len(texts) == 5, f"the legend does not tell five ways of colouring apart: {texts}")
    changes(page, "another baseline", lambda: page.locator("[name=baseline]").select_option(index=0))
    check("Center" in legend.inner_text() or "Line" in legend.inner_text(), "the legend names no baseline")
    colour.select_option("information")
    lidar = page.locator("[name=lidar]")
    changes(page, "beams of LiDAR 1", lambda: lidar.select_option("1"))
    one = int(told(page)["beams"])
    changes(page, "beams of all LiDARs", lambda: lidar.select_option("all"))
    check(0 < one < int(told(page)["beams"]), f"{one} beams of a LiDAR, {told(page)['beams']} of all")
    lidar.select_option("none")
    check(told(page)["beams"] == "0", "beams stay when none are asked for")
    frame = page.locator("[name=frame]")
    frame.focus()
    changes(page, "another frame", lambda: page.keyboard.press("End"))
    check(page.locator("#frame-number").inner_text() != "0", "the number of the frame stays")
    for name, key in [("surfaces", "triangles"), ("voxels", "voxels")]:
        box = page.locator(f"[name={name}]")
        changes(page, name, box.uncheck)
        check(told(page)[key] == "0", f"{key} are drawn without {name}")
        box.check()
    changes(page, "walls in full", page.locator("[name=whole]").check)


def scenes(page: Page, triangles: list[int]) -> None:
    """Each of several scenes is drawn when it is chosen, with its own frames and words."""
    choice = page.locator("[name=scene]")
    first = picture(page)
    for number, wanted in enumerate(triangles):
        if number > 0:
            changes(page, f"scene {number}", lambda number=number: choice.select_option(str(number)))
        state = told(page)
        drawn = int(state["triangles"])
        words = page.locator(".left-out:visible")
        merged = words.count() == 1 and f"The scene's {wanted} triangles are drawn as {drawn}" in words.inner_text()
        check(drawn == wanted or merged, f"{drawn} of {wanted} triangles of scene {number}, and nothing said")
        check(int(state["voxels"]) > 1000, f"only {state['voxels']} voxels of scene {number}")
        frame = page.locator("[name=frame]")
        check(frame.get_attribute("max") == "5", f"scene {number} has {frame.get_attribute('max')} frames behind the first")
        changes(page, f"another frame of scene {number}", lambda: frame.fill("5"))
        frame.fill("0")
    choice.select_option("0")
    check(picture(page) == first, "the first scene does not come back")


def axe(page: Page, what: str) -> None:
    found = Axe().run(page).response["violations"]
    grave = [f for f in found if f["impact"] in ("serious", "critical", "moderate")]
    words = [f"{f['id']}: {f['help']}: {f['nodes'][0]['html'][:200]}" for f in grave]
    check(not grave, f"axe finds in {what}: {json.dumps(words, indent=1)}")


def fits(page: Page, what: str) -> None:
    wide, screen = page.evaluate("[document.documentElement.scrollWidth, innerWidth]")
    check(wide <= screen, f"{what} is {wide} pixels wide on a screen of {screen}")


def kernels(tools, blank: Path) -> None:
    """Tint, which is not the compiler that the program has, takes every kernel, and a batch has the same words under WebGPU."""
    sources = sorted(Path("target/kernels").glob("*.wgsl"))
    check(len(sources) > 0, "no kernels in target/kernels: `cargo test --lib kernels` leaves them there")
    browser = tools.chromium.launch(executable_path=CHROMIUM, args=[*FLAGS, *GPU_FLAGS])
    page = browser.new_page()
    page.goto(f"file://{blank}")
    for source in sources:
        said = page.evaluate(COMPILE, [source.stem, source.read_text()])
        check(said == "", f"{source.name}: {said}")
    batch = json.loads(Path("target/kernels/batch/batch.json").read_text())
    read = lambda file: base64.b64encode((Path("target/kernels/batch") / file).read_bytes()).decode()
    files = [read(buffer["file"]) for buffer in batch["buffers"]]
    found = page.evaluate(RUN, [batch, files, {source.stem: source.read_text() for source in sources}])
    check(found == {"differing": [0, 0, 0, 0, 0], "said": []}, f"the kernels of a batch under WebGPU: {found}")
    words = sum(buffer["bytes"] // 4 for buffer in batch["buffers"] if buffer["made"])
    print(f"WebGPU: 0 of {words} words of hits, counters, bitmaps and sums differ")
    browser.close()


def main(folder: Path, renew: bool) -> None:
    run, view = folder / "run" / "report.html", folder / "view.html"
    triangles = json.loads((folder / "info.json").read_text())[0]["triangles"]
    for file in [run, view]:
        check(file.stat().st_size <= MOST_BYTES, f"{file.name} has {file.stat().st_size} bytes")
    with sync_playwright() as tools:
        kernels(tools, run)
        browser = tools.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        page = opened(browser, run, viewport=WIDE)
        draws(page, triangles)
        if renew:
            keep(page, "light")
        moves(page)
        controls(page)
        axe(page, "a light page")
        dark = opened(browser, run, "#colour=seen&lidar=1&zoom=1.6", viewport=WIDE, color_scheme="dark")
        axe(dark, "a dark page")
        check(int(told(dark)["beams"]) > 0, "the address does not choose the beams")
        phone = opened(browser, run, "#colour=difference", viewport=PHONE, has_touch=True)
        fits(phone, "the page")
        touches(phone)
        axe(phone, "a page on a phone")
        given = opened(browser, view, viewport=WIDE)
        check("Pyramid" in given.locator("h1").inner_text(), "the page does not name what it shows")
        check(given.locator("#search").count() == 0, "a page without a search tells of one")
        check("95 % interval" in given.locator("body").inner_text(), "two scenes, and no interval")
        scenes(given, [info["triangles"] for info in json.loads((folder / "both.json").read_text())])
        axe(given, "the page of a placement")
        second = opened(browser, view, "#frame=3&scene=1", viewport=WIDE)
        check(second.locator("[name=scene]").input_value() == "1", "the address does not choose the scene")
        check(second.locator("[name=frame]").input_value() == "3", "the address does not choose a frame of the scene")
        if renew:
            keep(dark, "dark")
            keep(phone, "phone")
        print_out = page.pdf(format="A4")
        check(len(print_out) > 50_000, "nothing is printed")
        browser.close()
        # Without WebGL2 the map stands in.
        browser = tools.chromium.launch(executable_path=CHROMIUM, args=[*FLAGS, "--disable-webgl", "--disable-webgl2"])
        plain = browser.new_context(viewport=WIDE).new_page()
        plain.goto(f"file://{run}")
        check(plain.evaluate("document.body.dataset.state") == "fallback", "no fallback without WebGL2")
        check(plain.locator("#view-fallback .paper svg").is_visible(), "no map without WebGL2")
        check(plain.locator("#view-fallback .meaning").is_visible(), "no meaning of the map without WebGL2")
        check(plain.locator("#map .meaning").count() == 0, "the meaning of the map stands above no map")
        browser.close()


main(Path(sys.argv[1]).resolve(), "--pictures" in sys.argv)
