// The stage: shows a picture and its mask, and turns pointer and keys into picks at working pixels.
const view = element.querySelector(".view");
const sheet = element.querySelector(".sheet");
const photo = element.querySelector(".photo");
const before = element.querySelector(".before");
const fill = element.querySelector(".fill");
const outline = element.querySelector(".outline");
const badge = element.querySelector(".badge");
const marks = element.querySelector(".marks");
const cross = element.querySelector(".cross");
let width = 0, height = 0, maskUrl = "", down = null, path = [], cursor = null, serial = 0, plain = "", rest;
let zoom = 1, left = 0, top = 0, grip = null;  // the sheet's size and place, shares of the view's
const fingers = new Map();

function show() {
  const v = props.value || {};
  if (v.serial && v.serial < serial) return;  // overtaken by a newer one
  serial = v.serial || serial;
  if (v.width !== undefined) { width = v.width; height = v.height; }  // 0: nothing can be clicked
  if (width) marks.setAttribute("viewBox", `0 0 ${width} ${height}`);
  if (v.picture) { if (v.picture !== photo.getAttribute("src")) photo.src = v.picture; }
  else if (v.picture !== undefined) photo.removeAttribute("src");
  if (v.before === "") plain = v.picture;  // what is shown is the photo
  if (v.picture) before.src = v.before || plain;
  view.classList.toggle("empty", !photo.hasAttribute("src"));
  view.style.cursor = width ? "" : "default";
  if (v.badge !== undefined) { badge.textContent = v.badge; view.dataset.kind = v.bad ? "bad" : v.badge.startsWith("Path traced") ? "final" : "live"; }
  if (v.fill !== undefined && v.fill !== maskUrl) {
    maskUrl = v.fill;
    outline.hidden = !v.outline;
    if (v.outline) outline.src = v.outline;
    fill.classList.remove("seen");
    fill.style.maskImage = fill.style.webkitMaskImage = v.fill ? `url(${v.fill})` : "none";
    void fill.offsetWidth;  // starts the animation again
    fill.classList.toggle("seen", !!v.fill);
    view.dataset.selected = v.fill ? "yes" : "";
  }
  if (v.waiting !== undefined) view.dataset.waiting = v.waiting ? "yes" : "";
  clearTimeout(rest);
  if (v.coarse) rest = setTimeout(() => trigger("follow", {}), 300);
  if (v.waiting) trigger("follow", {});
  if (v.lamps !== undefined) {
    const r = Math.max(width, height) / 60;
    marks.querySelectorAll(".lamp").forEach((n) => n.remove());
    for (const [x, y] of v.lamps) marks.append(circle(x, y, r, "lamp"));
  }
}

function circle(x, y, r, name) {
  const c = document.createElementNS("http://www.w3.org/2000/svg", "circle");
  c.setAttribute("cx", x); c.setAttribute("cy", y); c.setAttribute("r", r); c.setAttribute("class", name);
  return c;
}

const tool = () => document.body.dataset.tool || "click";
const size = () => parseFloat(document.body.dataset.brush || "12");
function mode(e) {
  if (e.shiftKey) return "add";
  if (e.altKey) return "remove";
  return document.body.dataset.mode || "new";
}
function at(e) {
  const box = sheet.getBoundingClientRect();
  const clamp = (v, top) => Math.min(Math.max(v, 0), top - 0.01);
  return [clamp((e.clientX - box.left) / box.width * width, width), clamp((e.clientY - box.top) / box.height * height, height)];
}
// Zoom by a factor about a place of the window, which moves on by (dx, dy).
function look(factor, x, y, dx = 0, dy = 0) {
  const box = view.getBoundingClientRect(), old = zoom;
  zoom = Math.min(Math.max(zoom * factor, 1), 16);
  const moved = (edge, place, by) => Math.min(Math.max(place + by - (place - edge) * zoom / old, 1 - zoom), 0);
  left = moved(left, (x - box.left) / box.width, dx / box.width);
  top = moved(top, (y - box.top) / box.height, dy / box.height);
  for (const [name, share] of [["width", zoom], ["height", zoom], ["left", left], ["top", top]]) sheet.style[name] = `${100 * share}%`;
}
function send(what) { view.classList.add("busy"); setTimeout(() => view.classList.remove("busy"), 4000); trigger("pick", what); }

function trace() {
  marks.querySelectorAll(".trace").forEach((n) => n.remove());
  if (!down) return;
  const [x0, y0] = path[0], [x1, y1] = path[path.length - 1];
  if (tool() === "box") {
    const r = document.createElementNS("http://www.w3.org/2000/svg", "rect");
    r.setAttribute("x", Math.min(x0, x1)); r.setAttribute("y", Math.min(y0, y1));
    r.setAttribute("width", Math.abs(x1 - x0)); r.setAttribute("height", Math.abs(y1 - y0));
    r.setAttribute("class", "trace rect"); marks.append(r);
  } else if (tool() === "brush") {
    const l = document.createElementNS("http://www.w3.org/2000/svg", "polyline");
    l.setAttribute("points", path.map((p) => p.join(",")).join(" "));
    l.setAttribute("stroke-width", 2 * size()); l.setAttribute("class", `trace stroke ${down}`); marks.append(l);
  }
}
// Where the brush is and how wide it paints; red where it rubs out.
function ring(e) {
  marks.querySelectorAll(".ring").forEach((n) => n.remove());
  if (e && width && tool() === "brush") marks.append(circle(...at(e), size(), `ring ${down || mode(e)}`));
}

// A portrait must not push its tools out of sight.
photo.addEventListener("load", () => {
  view.style.aspectRatio = `${photo.naturalWidth} / ${photo.naturalHeight}`;
  view.style.maxWidth = `calc(72vh * ${photo.naturalWidth / photo.naturalHeight})`;
});
view.addEventListener("wheel", (e) => {
  if (!width || (zoom === 1 && e.deltaY > 0)) return;  // the page scrolls on
  e.preventDefault();
  look(Math.exp(-e.deltaY * (e.deltaMode ? 33 : 1) / 400), e.clientX, e.clientY);
}, { passive: false });
view.addEventListener("pointerdown", (e) => {
  if (!width) return;
  fingers.set(e.pointerId, e);
  if (e.button === 1 || e.ctrlKey || e.metaKey) { grip = e; view.setPointerCapture(e.pointerId); e.preventDefault(); return; }
  if (!e.isPrimary) { down = null; trace(); }
  if (e.button || !e.isPrimary) return;
  down = mode(e); path = [at(e)]; cross.style.display = "none"; cursor = null;
  if (tool() === "box" || tool() === "brush") { view.setPointerCapture(e.pointerId); e.preventDefault(); trace(); ring(e); }
});
view.addEventListener("pointermove", (e) => {
  const old = fingers.get(e.pointerId), other = [...fingers.values()].find((f) => f !== old);
  if (old) fingers.set(e.pointerId, e);
  if (old && other) {  // two fingers: each moves the middle by half
    const far = (f) => Math.hypot(f.clientX - other.clientX, f.clientY - other.clientY);
    look(far(e) / Math.max(far(old), 1), (old.clientX + other.clientX) / 2, (old.clientY + other.clientY) / 2, (e.clientX - old.clientX) / 2, (e.clientY - old.clientY) / 2);
  } else if (grip) { look(1, 0, 0, e.clientX - grip.clientX, e.clientY - grip.clientY); grip = e; }
  if (!e.isPrimary) return;
  if (down && tool() !== "click") { path.push(at(e)); trace(); }
  ring(e);
});
for (const over of ["pointerup", "pointercancel", "pointerleave"]) view.addEventListener(over, (e) => { fingers.delete(e.pointerId); grip = null; });
view.addEventListener("pointerleave", () => { if (!down) ring(null); });
view.addEventListener("pointercancel", () => { down = null; trace(); ring(null); });
view.addEventListener("pointerup", (e) => {
  if (!down || !e.isPrimary) return;
  const how = down; path.push(at(e)); finish(tool(), how); down = null; trace(); ring(e.pointerType === "mouse" ? e : null);
});
function finish(kind, how) {
  const [x0, y0] = path[0], [x1, y1] = path[path.length - 1];
  if (kind === "box") send({ tool: "box", mode: how, at: [x0, y0, x1, y1] });
  else if (kind === "brush") send({ tool: "brush", mode: how === "new" ? "add" : how, points: path.slice(0, 20000), radius: size() });
  else send({ tool: kind, mode: how, at: [x0, y0] });
}

// Keys: arrows move a cross, Enter or Space clicks there; Shift and Alt as with the pointer.
view.addEventListener("keydown", (e) => {
  if (!width) return;
  const factor = e.ctrlKey || e.metaKey ? 0 : { "+": 1.5, "=": 1.5, "-": 1 / 1.5, 0: 0.01 }[e.key];
  if (factor) {
    const box = (cursor ? cross : view).getBoundingClientRect();
    return look(factor, box.left + box.width / 2, box.top + box.height / 2);
  }
  const step = (e.ctrlKey ? 1 : Math.max(width, height) / 40);
  const move = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[e.key];
  if (move) {
    cursor = cursor || [width / 2, height / 2];
    cursor = [Math.min(Math.max(cursor[0] + move[0] * step, 0), width - 1), Math.min(Math.max(cursor[1] + move[1] * step, 0), height - 1)];
    cross.style.display = "block"; cross.style.left = `${100 * cursor[0] / width}%`; cross.style.top = `${100 * cursor[1] / height}%`;
    const box = view.getBoundingClientRect(), here = cross.getBoundingClientRect();  // it stays in sight
    const back = (from, to, low, high) => Math.max(low - from, 0) + Math.min(high - to, 0);
    look(1, 0, 0, back(here.left, here.right, box.left, box.right), back(here.top, here.bottom, box.top, box.bottom));
    e.preventDefault();
  } else if ((e.key === "Enter" || e.key === " ") && cursor) {
    const kind = tool() === "brush" || tool() === "box" ? "brush" : tool();
    path = [cursor]; finish(kind, mode(e)); e.preventDefault();
  }
});
view.addEventListener("dragstart", (e) => e.preventDefault());
show();
watch("value", () => { view.classList.remove("busy"); show(); });
