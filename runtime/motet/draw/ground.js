// The ground, which is endless, with fine checks that fade into the horizon; and what lies on it: trails, discs, and
// the darkness under what touches it.

const GROUND_CORNERS = `
uniform vec3 right, up, toward;
uniform float tall, wide;
out vec3 ray;
void main() {
  vec2 corner = vec2(gl_VertexID == 1 ? 3. : -1., gl_VertexID == 2 ? 3. : -1.);
  ray = right * corner.x * wide + up * corner.y * tall - toward;
  gl_Position = vec4(corner, 0, 1);
}`;

const GROUND = `
uniform vec3 eye, middle, under, fog, sky, light, dark;
uniform float reach, shade, shadeReach, pixel; // pixel: how wide one is at a distance of 1
const float FINE = 6.; // checks in a height
in vec3 ray;
out vec4 ink;
/** 0 or 1 in turns, smoothed over what a pixel covers. */
float checks(vec2 place, vec2 wide) {
  vec2 rise = 2. * (abs(fract((place - .5 * wide) * .5) - .5) - abs(fract((place + .5 * wide) * .5) - .5)) / wide;
  return .5 - .5 * rise.x * rise.y;
}
void main() {
  float far = -eye.y / ray.y, rise = abs(ray.y);
  if (far <= 0. || far > 5. * reach) {
    ink = vec4(mix(fog, sky, smoothstep(0., .5, rise)), 1);
    return;
  }
  vec3 at = eye + far * ray, from = at - middle;
  float wide = far * pixel * FINE / max(rise, .05), contrast = 1. - smoothstep(.5, 2.2, wide);
  float own = contrast > 0. ? .5 + contrast * (checks(at.xz * FINE, vec2(min(wide, 3.))) - .5) : .5;
  vec2 shared_ = vec2(dot(from.xz, from.xz), far * far * .2) / (reach * reach);
  float clear = 1. / (1. + 1.2 * (shared_.x + shared_.y) + 2. * shared_.x * shared_.x);
  vec2 shadow = at.xz - under.xz;
  float lit = dot(shadow, shadow) < shadeReach * shadeReach ? sunlit(at) : 1.;
  ink = vec4(mix(fog, mix(light, dark, own) * (1. - shade * (1. - lit)), clear), 1);
}`;

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

const MARK_NUMBERS = 9, APART = 0.12;

/** Of the points of a way those that are some way apart, and its ends. */
function apart(points) {
  let before = points[0];
  return points.filter((point, n) => {
    const kept = n === 0 || n === points.length - 1 || Math.hypot(point[0] - before[0], point[1] - before[1]) > APART;
    if (kept) before = point;
    return kept;
  });
}

/** Corners of what lies on the ground: x, z, place across (2), colour and alpha (4), from where on it fades to its edge. */
class Marks {
  constructor() {
    this.numbers = [];
  }

  quad(corners, across, colours, hard) {
    for (const n of [0, 1, 2, 2, 1, 3]) this.numbers.push(...corners[n], ...across[n], ...colours[n], hard);
  }

  /** A disc; hard: from 0, soft all over, to 1. */
  spot({ x, z, radius, colour, alpha = 0.5, hard = 0.85 }) {
    const square = [[-1, -1], [1, -1], [-1, 1], [1, 1]], paint = [...colour.map((part) => part / 255), alpha];
    this.quad(square.map(([a, b]) => [x + a * radius, z + b * radius]), square, square.map(() => paint), hard);
  }

  /** A band along points; fade: it begins with nothing ("start"), or ends so (true). arrows: heads along it. */
  strip({ points: given, colour, alpha = 0.5, width = 0.012, fade = false, arrows = false }) {
    const points = apart(given), rgb = colour.map((part) => part / 255), last = points.length - 1;
    const beside = points.map((_, n) => {
      const [a, b] = [points[Math.max(n - 1, 0)], points[Math.min(n + 1, last)]];
      const [dx, dz] = unit([b[0] - a[0], b[1] - a[1]]);
      return [-dz * width / 2, dx * width / 2];
    });
    const ends = (n) => [1, -1].map((side) => [points[n][0] + side * beside[n][0], points[n][1] + side * beside[n][1]]);
    const paint = (n) => [...rgb, alpha * (fade === "start" ? n / last : fade ? 1 - n / last : 1)];
    for (let n = 0; n < last; n++) {
      const colours = [paint(n), paint(n), paint(n + 1), paint(n + 1)];
      this.quad([...ends(n), ...ends(n + 1)], [[0, 1], [0, -1], [0, 1], [0, -1]], colours, 0.7);
    }
    if (arrows && last > 0) this.arrow(points[last], unit([0, 1].map((n) => points[last][n] - points[last - 1][n])), width, [...rgb, alpha]);
  }

  arrow([x, z], [dx, dz], width, colour) {
    const size = 1.6 * width, tip = [x + 2 * size * dx, z + 2 * size * dz];
    const wings = [1, -1].map((side) => [x - side * size * dz, z + side * size * dx]);
    this.quad([wings[0], wings[1], tip, tip], [[0, 0], [0, 0], [0, 0], [0, 0]], [colour, colour, colour, colour], 1);
  }
}

/** The darkness under joints that are near the ground: the nearer the darker. */
function darken(marks, { places, unit: size = 1 }, alpha) {
  for (const place of places ?? []) {
    const height = size * place[1];
    if (height > 0.13) continue;
    const near = 1 - Math.max(0, height) / 0.13;
    marks.spot({ x: size * place[0], z: size * place[2], radius: 0.05 + 0.035 * (1 - near), colour: [0, 0, 0], alpha: alpha * near, hard: 0 });
  }
}
