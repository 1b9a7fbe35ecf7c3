// What all pages draw with, in canvas 2D: one view, the ground, bodies and their shadows, and the pointer that turns the
// view. Lengths are body heights, y is up, the ground is y = 0.

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

/** The camera that looks at a place; yaw of the view is from heading (radians), away adds to its distance. */
function cameraAt(target, heading, away, width, height) {
  const yaw = heading + view.yaw * Math.PI / 180, pitch = view.pitch * Math.PI / 180;
  const [sinY, cosY, sinP, cosP] = [Math.sin(yaw), Math.cos(yaw), Math.sin(pitch), Math.cos(pitch)];
  return {
    target, right: [cosY, 0, -sinY], up: [-sinP * sinY, cosP, -sinP * cosY], toward: [cosP * sinY, sinP, cosP * cosY],
    distance: (DISTANCE + away) / view.zoom,
    focal: FOCAL * Math.min(height, width * 1.1), x: width / 2, y: height / 2,
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

// ---- drawing --------------------------------------------------------------------------------------------------

const COLOURS = { left: [236, 122, 52], right: [58, 124, 226], middle: [176, 182, 196] };
const LIGHT = unit([0.35, 1, 0.45]);
const CELL = 0.25, GROUND_CELLS = 12, FADES = 6;

/** The canvas without anything on it, as sharp as the screen is: its size in pixels of the page, and how many of the
 *  screen's one of them is. */
function cleared(canvas, ink) {
  const ratio = window.devicePixelRatio || 1, width = canvas.clientWidth, height = canvas.clientHeight;
  if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(height * ratio);
  }
  ink.setTransform(ratio, 0, 0, ratio, 0, 0);
  ink.clearRect(0, 0, width, height);
  return { width, height, ratio };
}

/** Squares on the ground around the camera's target, fading with distance: one path for each step of fading. */
function drawGrid(ink, camera, colour) {
  const paths = Array.from({ length: FADES }, () => new Path2D());
  const [midX, midZ] = [camera.target[0], camera.target[2]], reach = GROUND_CELLS * CELL;
  const [firstX, firstZ] = [midX, midZ].map((x) => Math.round(x / CELL) - GROUND_CELLS);
  const piece = (x, z, toX, toZ) => {
    const away = Math.hypot((x + toX) / 2 - midX, (z + toZ) / 2 - midZ) / reach;
    const from = project(camera, [x, 0, z]), to = project(camera, [toX, 0, toZ]);
    if (away >= 1 || from.depth < NEAR || to.depth < NEAR) return;
    const path = paths[Math.floor(away * FADES)];
    path.moveTo(from.x, from.y);
    path.lineTo(to.x, to.y);
  };
  for (let i = 0; i <= 2 * GROUND_CELLS; i++) {
    for (let j = 0; j <= 2 * GROUND_CELLS; j++) {
      const [x, z] = [(firstX + i) * CELL, (firstZ + j) * CELL];
      piece(x, z, x + CELL, z);
      piece(x, z, x, z + CELL);
    }
  }
  ink.lineWidth = 1;
  paths.forEach((path, fade) => {
    ink.strokeStyle = `rgb(${colour} / ${0.3 * (1 - fade / FADES) ** 1.5})`;
    ink.stroke(path);
  });
}

/** The hull of two circles as the angles where its straight sides touch them; null if one holds the other. */
function touching(from, to) {
  const length = Math.hypot(to.x - from.x, to.y - from.y);
  if (length <= Math.abs(from.r - to.r) + 1e-9) return null;
  const along = Math.atan2(to.y - from.y, to.x - from.x), open = Math.acos((from.r - to.r) / length);
  return [along - open, along + open];
}

/** The bones of all poses thrown on the ground along the light. The path lies far left of the canvas, only its blur falls on it. */
function drawShadow(ink, camera, bones, poses, ratio, style) {
  const path = new Path2D(), aside = 20000;
  const ground = (point, r) => ({
    x: point[0] - point[1] * LIGHT[0] / LIGHT[1], y: point[2] - point[1] * LIGHT[2] / LIGHT[1], r,
  });
  for (const pose of poses) {
    for (const [start, end, startRadius, endRadius] of bones) {
      const outline = hullPoints(ground(pose[start], startRadius), ground(pose[end], endRadius));
      const corners = outline.map(([x, z]) => project(camera, [x, 0, z]));
      if (corners.some((corner) => corner.depth < NEAR)) continue;
      corners.forEach(({ x, y }, n) => (n ? path.lineTo(x - aside, y) : path.moveTo(x - aside, y)));
      path.closePath();
    }
  }
  ink.save();
  ink.shadowColor = `rgb(${style.getPropertyValue("--shadow")} / ${style.getPropertyValue("--shade")})`;
  ink.shadowBlur = 0.035 * ratio * camera.focal / camera.distance;
  ink.shadowOffsetX = aside * ratio;
  ink.fill(path);
  ink.restore();
}

function hullPoints(from, to) {
  const angles = touching(from, to), points = [], steps = 8;
  const arc = (circle, start, end) => {
    for (let i = 0; i <= steps; i++) {
      const angle = mix(start, end, i / steps);
      points.push([circle.x + circle.r * Math.cos(angle), circle.y + circle.r * Math.sin(angle)]);
    }
  };
  if (!angles) {
    arc(from.r > to.r ? from : to, 0, 2 * Math.PI);
  } else {
    arc(from, angles[1], angles[0] + 2 * Math.PI);
    arc(to, angles[0], angles[1]);
  }
  return points;
}

/** Far bones first, each filled with the light across a cylinder; a part of the light comes from the viewer. */
function drawBones(ink, camera, bones, pose) {
  const lamp = unit([0, 1, 2].map((n) => LIGHT[n] + 0.6 * camera.toward[n] - 0.3 * camera.right[n]));
  const light = [camera.right, camera.up, camera.toward].map((axis) => dot(axis, lamp));
  const seen = pose.map((point) => project(camera, point));
  const order = bones.map((bone) => ({ bone, depth: (seen[bone[0]].depth + seen[bone[1]].depth) / 2 }));
  order.sort((a, b) => b.depth - a.depth);
  ink.lineWidth = 1;
  for (const { bone, depth } of order) {
    const [start, end, startRadius, endRadius, side] = bone, a = seen[start], b = seen[end];
    if (a.depth < NEAR || b.depth < NEAR) continue;
    const from = { x: a.x, y: a.y, r: startRadius * a.scale }, to = { x: b.x, y: b.y, r: endRadius * b.scale };
    const offset = [0, 1, 2].map((n) => pose[end][n] - pose[start][n]);
    const axis = unit([camera.right, camera.up, camera.toward].map((way) => dot(way, offset)));
    const fog = clamp(0.5 + 0.35 * (depth - camera.distance), 0, 1) * 0.3;
    ink.fillStyle = lit(ink, from, to, axis, light, COLOURS[side], fog);
    ink.strokeStyle = `rgb(0 0 0 / ${0.16 * (1 - fog)})`;
    capsule(ink, from, to);
    ink.fill();
    ink.stroke();
  }
}

function capsule(ink, from, to) {
  const angles = touching(from, to);
  ink.beginPath();
  if (!angles) {
    const larger = from.r > to.r ? from : to;
    ink.arc(larger.x, larger.y, larger.r, 0, 2 * Math.PI);
  } else {
    ink.arc(from.x, from.y, from.r, angles[1], angles[0]);
    ink.arc(to.x, to.y, to.r, angles[0], angles[1]);
  }
  ink.closePath();
}

/** A gradient across a bone: at each place the light on the normal that a cylinder has there. */
function lit(ink, from, to, axis, light, colour, fog) {
  const flat = Math.hypot(axis[0], axis[1]);
  const across = flat > 0.05 ? [-axis[1] / flat, axis[0] / flat, 0] : unit([light[0], light[1], 0]);
  const front = unit([-0.8 * axis[2] * axis[0], -0.8 * axis[2] * axis[1], 1 - 0.8 * axis[2] * axis[2]]);
  const [x, y, r] = [(from.x + to.x) / 2, (from.y + to.y) / 2, Math.max(from.r, to.r)];
  const [dx, dy] = [across[0] * r, -across[1] * r];
  const gradient = ink.createLinearGradient(x - dx, y - dy, x + dx, y + dy);
  for (let place = -1; place <= 1; place += 0.25) {
    const facing = Math.sqrt(1 - place * place);
    const normal = unit([0, 1, 2].map((n) => place * across[n] + facing * front[n]));
    gradient.addColorStop((place + 1) / 2, shade(colour, dot(normal, light), facing, fog));
  }
  return gradient;
}

function shade(colour, towardLight, facing, fog) {
  const light = 0.34 + 0.78 * ((1 + towardLight) / 2) ** 1.5, rim = 0.8 + 0.2 * facing;
  const shine = 70 * Math.max(0, towardLight) ** 12;
  return `rgb(${colour.map((c) => Math.round(mix(Math.min(255, c * light * rim + shine), 128, fog)))})`;
}

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
