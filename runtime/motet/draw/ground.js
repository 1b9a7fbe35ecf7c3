// The ground, which is endless, with fine checks that fade into the horizon; and what lies on it: trails, discs, and
// the darkness under what touches it.

/** A corner of the two triangles of each cell, as whole numbers across and up. */
const CELL = `
ivec2 corner(int n) { return ivec2(n == 1 || n > 3, n == 2 || n == 3 || n == 5); }`;

const SKY_ROWS = 8, SECTORS = 24, RINGS = 12, FINE = 6; // checks in a height

const SKY = `${CELL}
uniform vec3 up, toward, fog, sky;
uniform float tall;
out vec3 colour;
void main() {
  ivec2 at = corner(gl_VertexID % 6);
  float horizon = clamp(toward.y / max(up.y * tall, .001), -1., 1.);
  float y = mix(horizon, 1., float(gl_VertexID / 6 + at.y) / float(${SKY_ROWS}));
  colour = mix(fog, sky, smoothstep(0., .5, up.y * tall * y - toward.y));
  gl_Position = vec4(float(2 * at.x - 1), y, 0, 1);
}`;

const PLAIN = `
in vec3 colour;
out vec4 ink;
void main() { ink = vec4(colour, 1); }`;

const CLEAR = `
uniform vec3 eye, middle;
uniform float reach;
/** How little of the fog lies over a place on the ground. */
float clearAt(vec3 at) {
  vec3 from = at - middle, far = at - eye;
  float around = dot(from.xz, from.xz) / (reach * reach), away = .2 * dot(far, far) / (reach * reach);
  return 1. / (1. + 1.2 * (around + away) + 2. * around * around);
}`;

/** Rings of cells around what is looked at; what changes slowly is counted at their corners. */
const GROUND = `${CELL}${CLEAR}
uniform mat4 clip;
uniform vec3 fog, light, dark;
out vec2 place;
out vec3 base, stripe;
void main() {
  int cell = gl_VertexID / 6;
  ivec2 here = corner(gl_VertexID % 6) + ivec2(cell % ${SECTORS}, cell / ${SECTORS});
  float turn = radians(360.) * float(here.x) / float(${SECTORS}), part = float(here.y) / float(${RINGS});
  vec3 at = vec3(middle.x, 0, middle.z) + 5. * reach * part * part * vec3(sin(turn), 0, cos(turn));
  float clear = clearAt(at);
  base = mix(fog, .5 * (light + dark), clear);
  stripe = .5 * clear * (dark - light);
  place = .5 * float(${FINE}) * at.xz;
  gl_Position = clip * vec4(at, 1);
}`;

const CHECKS = `
uniform float sharp; // how fast checks change, of their size, in a pixel at a distance of 1
in vec2 place;
in vec3 base, stripe;
out vec4 ink;
void main() {
  float edge = sharp * gl_FragCoord.w * gl_FragCoord.w, contrast = clamp(.16 * edge - .29, 0., 1.);
  vec2 wave = clamp(edge * (abs(fract(place) - .5) - .25), -1., 1.);
  ink = vec4(base - stripe * (contrast * wave.x * wave.y), 1);
}`;

const SHADED = `${CLEAR}
uniform mat4 clip;
layout(location = 0) in vec2 place;
out vec3 at;
out float clear;
void main() {
  at = vec3(place.x, 0, place.y);
  clear = clearAt(at);
  gl_Position = clip * vec4(at, 1);
}`;

const SHADOW = `
uniform float shade;
in vec3 at;
in float clear;
out vec4 ink;
void main() { ink = vec4(0, 0, 0, shade * clear * (1. - sunlit(at))); }`;

const MARKS = `
uniform mat4 clip;
layout(location = 0) in vec4 place;
layout(location = 1) in vec4 paint;
layout(location = 2) in float hard;
out vec2 across;
out vec4 colour;
out float edge;
void main() {
  across = place.zw;
  colour = paint;
  edge = hard;
  gl_Position = clip * vec4(place.x, 0, place.y, 1);
}`;

const MARK = `
in vec2 across;
in vec4 colour;
in float edge;
out vec4 ink;
void main() {
  ink = vec4(colour.rgb, colour.a * (1. - smoothstep(edge, 1., length(across))));
}`;

const APART = 0.12, SHADE_CELL = 0.1, SHADE_AROUND = 0.14;

/** Of the points of a way those that are some way apart, and its ends. */
function apart(points) {
  let before = points[0];
  return points.filter((point, n) => {
    const [dx, dz] = [point[0] - before[0], point[1] - before[1]];
    const kept = n === 0 || n === points.length - 1 || dx * dx + dz * dz > APART * APART;
    if (kept) before = point;
    return kept;
  });
}

/** Corners of what lies on the ground: x, z, place across (2), colour and alpha (4), from where on it fades to its edge. */
class Marks {
  constructor() {
    this.numbers = new Float32Array(1 << 12);
    this.count = 0;
  }

  made() {
    return this.numbers.subarray(0, this.count);
  }

  corner(x, z, a, b, colour, alpha, hard) {
    const { numbers, count } = this;
    numbers[count] = x; numbers[count + 1] = z; numbers[count + 2] = a; numbers[count + 3] = b;
    numbers[count + 4] = colour[0] / 255; numbers[count + 5] = colour[1] / 255; numbers[count + 6] = colour[2] / 255;
    numbers[count + 7] = alpha; numbers[count + 8] = hard;
    this.count += 9;
  }

  /** Two triangles of corners [x, z, a, b] in rows, the second half with an alpha of its own. */
  quad(corners, colour, alpha, hard, further = alpha) {
    if (this.count + 54 > this.numbers.length) {
      const more = new Float32Array(2 * this.numbers.length);
      more.set(this.numbers);
      this.numbers = more;
    }
    for (const n of [0, 1, 2, 2, 1, 3]) {
      const [x, z, a, b] = corners[n];
      this.corner(x, z, a, b, colour, n > 1 ? further : alpha, hard);
    }
  }

  /** A disc; hard: from 0, soft all over, to 1. */
  spot({ x, z, radius, colour, alpha = 0.5, hard = 0.85 }) {
    const corners = [[-1, -1], [1, -1], [-1, 1], [1, 1]].map(([a, b]) => [x + a * radius, z + b * radius, a, b]);
    this.quad(corners, colour, alpha, hard);
  }

  /** A band along points; fade: it begins with nothing ("start"), or ends so (true). arrows: a head at its end. */
  strip({ points: given, colour, alpha = 0.5, width = 0.012, fade = false, arrows = false }) {
    const points = apart(given), last = points.length - 1;
    const ends = points.map(([x, z], n) => {
      const [a, b] = [points[Math.max(n - 1, 0)], points[Math.min(n + 1, last)]];
      const [dx, dz] = [b[0] - a[0], b[1] - a[1]], half = width / 2 / (Math.sqrt(dx * dx + dz * dz) || 1);
      return [[x - dz * half, z + dx * half, 0, 1], [x + dz * half, z - dx * half, 0, -1]];
    });
    const clear = (n) => alpha * (fade === "start" ? n / last : fade ? 1 - n / last : 1);
    for (let n = 0; n < last; n++) this.quad([...ends[n], ...ends[n + 1]], colour, clear(n), 0.7, clear(n + 1));
    if (arrows && last > 0) this.arrow(points[last], unit([0, 1].map((n) => points[last][n] - points[last - 1][n])), width, colour, alpha);
  }

  arrow([x, z], [dx, dz], width, colour, alpha) {
    const size = 1.6 * width, tip = [x + 2 * size * dx, z + 2 * size * dz, 0, 0];
    const wings = [1, -1].map((side) => [x - side * size * dz, z + side * size * dx, 0, 0]);
    this.quad([wings[0], wings[1], tip, tip], colour, alpha, 1);
  }
}

/** The darkness under joints that are near the ground: the nearer the darker. */
function darken(marks, { places, unit: size = 1 }, alpha) {
  for (const place of places) {
    const height = size * place[1];
    if (height > 0.13) continue;
    const near = 1 - Math.max(0, height) / 0.13;
    marks.spot({ x: size * place[0], z: size * place[2], radius: 0.05 + 0.035 * (1 - near), colour: [0, 0, 0], alpha: alpha * near, hard: 0 });
  }
}

/** Corners x, z of triangles that cover boxes, and what of a body reaches out of them, once: the cells that they touch. */
function covered(boxes) {
  const cells = new Set(), cell = (at) => Math.floor(at / SHADE_CELL);
  for (const [low, high] of boxes) {
    const [left, near] = low.map((at) => cell(at - SHADE_AROUND)), [right, far] = high.map((at) => cell(at + SHADE_AROUND));
    for (let x = left; x <= right; x++) for (let z = near; z <= far; z++) cells.add(x * 65536 + z);
  }
  const places = new Float32Array(12 * cells.size);
  let at = 0;
  for (const one of cells) {
    const x = Math.round(one / 65536), z = one - 65536 * x;
    for (const corner of [0, 1, 2, 2, 1, 3]) {
      places[at++] = (x + corner % 2) * SHADE_CELL;
      places[at++] = (z + (corner >> 1)) * SHADE_CELL;
    }
  }
  return places;
}
