// What all pages share: one view, its camera, and the pointer that turns it. Lengths are body heights, y is up, the ground
// is y = 0.

const $ = (id) => document.getElementById(id);

function element(tag, parent, className) {
  const made = document.createElement(tag);
  if (className) made.className = className;
  parent.append(made);
  return made;
}

// ---- view -----------------------------------------------------------------------------------------------------
// Zoom 1 shows about 1.5 heights. dirty: something has changed that is to be drawn.

const FIRST_VIEW = { yaw: 40, pitch: 12, zoom: 1 };
const DISTANCE = 3.4, FOCAL = 2.45, NEAR = 0.2;
const view = { ...FIRST_VIEW, dirty: true };

/** The camera that looks at a place; yaw of the view is from heading (radians), away adds to its distance. covered: pixels
 *  at the lower end that something lies over, above which the place is in the middle. */
function cameraAt(target, heading, away, width, height, covered = 0) {
  const yaw = heading + view.yaw * Math.PI / 180, pitch = view.pitch * Math.PI / 180;
  const [sinY, cosY, sinP, cosP] = [Math.sin(yaw), Math.cos(yaw), Math.sin(pitch), Math.cos(pitch)];
  const up = [-sinP * sinY, cosP, -sinP * cosY], distance = (DISTANCE + away) / view.zoom;
  const focal = FOCAL * Math.min(height - covered, width * 1.1), down = covered / 2 * distance / focal;
  return {
    target: target.map((x, n) => x - down * up[n]), right: [cosY, 0, -sinY], up, toward: [cosP * sinY, sinP, cosP * cosY],
    distance, focal, x: width / 2, y: height / 2,
  };
}

function turn(yaw, pitch) {
  view.yaw = (view.yaw + yaw) % 360;
  view.pitch = clamp(view.pitch + pitch, -5, 89);
  view.dirty = true;
}

function zoom(factor) {
  view.zoom = clamp(view.zoom * factor, 0.2, 5);
  view.dirty = true;
}

function resetView() {
  Object.assign(view, FIRST_VIEW);
  view.dirty = true;
}

function setTheme(dark) {
  document.documentElement.dataset.theme = dark ? "dark" : "light";
  view.dirty = true;
}

const isDark = () => document.documentElement.dataset.theme === "dark";
window.onresize = () => { view.dirty = true; };

/** A point of the world on the canvas: x, y, its depth, and how many pixels a height is there. */
function project(camera, point) {
  const offset = [point[0] - camera.target[0], point[1] - camera.target[1], point[2] - camera.target[2]];
  const depth = camera.distance - dot(offset, camera.toward), scale = camera.focal / Math.max(depth, NEAR);
  return {
    x: camera.x + scale * dot(offset, camera.right), y: camera.y - scale * dot(offset, camera.up), depth, scale,
  };
}

/** What is seen at a pixel of the page: where the eye is, and where it looks. */
function rayAt(camera, x, y) {
  const [aside, above] = [(x - camera.x) / camera.focal, (camera.y - y) / camera.focal];
  const ray = [0, 1, 2].map((n) => aside * camera.right[n] + above * camera.up[n] - camera.toward[n]);
  return { eye: camera.target.map((at, n) => at + camera.distance * camera.toward[n]), ray };
}

const COLOURS = { left: [236, 122, 52], right: [58, 124, 226], middle: [176, 182, 196] };

// ---- pointer: one finger or the mouse turns, two fingers zoom ----------------------------------------------------

const pointers = new Map();

function spread() {
  const [a, b] = [...pointers.values()];
  return Math.hypot(a.x - b.x, a.y - b.y) || 1;
}

function listen(canvas) {
  canvas.onpointerdown = (event) => {
    canvas.setPointerCapture(event.pointerId);
    pointers.set(event.pointerId, { x: event.clientX, y: event.clientY });
  };
  canvas.onpointermove = (event) => {
    const before = pointers.get(event.pointerId), now = { x: event.clientX, y: event.clientY };
    if (!before) return;
    const wide = pointers.size === 2 ? spread() : 0;
    pointers.set(event.pointerId, now);
    if (wide) zoom(spread() / wide);
    else turn((before.x - now.x) * 0.4, (now.y - before.y) * 0.3);
  };
  canvas.onpointerup = canvas.onpointercancel = (event) => pointers.delete(event.pointerId);
  canvas.addEventListener("wheel", (event) => {
    event.preventDefault();
    zoom(Math.exp(-0.0015 * event.deltaY * (event.deltaMode ? 16 : 1)));
  }, { passive: false });
}
