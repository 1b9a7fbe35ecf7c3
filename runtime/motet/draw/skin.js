// Bodies: meshes that joints carry. Corners are moved here, once for a picture and its shadow, not on the graphics card:
// so a figure costs the same with and without one.

/** The colours of bodies, of which each figure has one. */
const BODIES = [
  [168, 179, 198], [203, 168, 154], [160, 186, 162], [184, 169, 202], [205, 189, 150], [148, 186, 190], [202, 164, 178],
  [176, 178, 182],
];
/** The colours of a body's parts in their order, of which the first is the body; and of these and further bodies, from 0 to 1. */
const PARTS = [BODIES[0], COLOURS.left, COLOURS.right, COLOURS.middle];
const PALETTE = [...PARTS, ...BODIES.slice(1)].flat().map((x) => x / 255);

const CAST = `
uniform mat4 clip;
layout(location = 0) in vec3 place;
void main() { gl_Position = clip * vec4(place, 1); }`;

const SHADOW_ONLY = "void main() {}";

/** How much of the sun reaches a place, 0 to 1: looks so often at the shadow map around it, or never and takes all. */
const SHADE = `
uniform sampler2DShadow shadows;
uniform mat4 sunClip;
uniform float softness, grain;
const vec2 AROUND[8] = vec2[8](vec2(.93, .12), vec2(-.75, -.55), vec2(-.35, .87), vec2(.55, -.78), vec2(-.9, .3),
  vec2(.42, .81), vec2(-.08, -.5), vec2(.18, .25));
float sunlit(vec3 place) {
  if (TAPS == 0) return 1.;
  vec3 seen = (sunClip * vec4(place, 1)).xyz * .5 + .5;
  float sum = 0.;
  for (int k = 0; k < TAPS; k++) sum += texture(shadows, vec3(seen.xy + softness * AROUND[k], seen.z - grain));
  return sum / float(TAPS);
}`;

/** The colour of a place on a body in this light, and behind the fog. */
const LIGHT = `
uniform vec3 sun, fog;
uniform float night;
vec3 shown(vec3 paint, vec3 at, vec3 normal, vec3 away, float clear) {
  float key = max(dot(normal, sun), 0.) * sunlit(at + normal * .014);
  float low = mix(.72, 1., clamp((at.y + .12 * normal.y) / .3, 0., 1.));
  vec3 around = mix(vec3(.55, .53, .52), vec3(.68, .70, .75), .5 + .5 * normal.y) * low;
  float edge = 1. - max(dot(normal, away), 0.), rim = edge * edge * edge * (.5 + .5 * normal.y);
  float half_ = max(dot(normal, normalize(sun + away)), 0.), shine = half_ * half_;
  shine *= shine;
  shine *= shine;
  vec3 light = around * mix(1., .9, night) + vec3(.53, .50, .45) * key;
  return mix(fog, paint * light + .09 * shine * shine * key + rim * mix(.10, .16, night), clear);
}`;

/** QUICK: light is found at corners, not for each pixel. */
const CORNERS = `
uniform mat4 clip;
uniform vec3 eye;
uniform vec3 palette[${PALETTE.length / 3}];
uniform float reach;
layout(location = 0) in vec3 place;
layout(location = 1) in vec3 normal;
layout(location = 2) in vec2 paint;
out vec3 at, facing, toEye, own;
out vec2 uv;
out float clear;
void main() {
  at = place;
  facing = normal;
  toEye = eye - place;
  float far = length(toEye) / (1.6 * reach);
  clear = exp(-far * far);
#ifdef TEXTURED
  uv = paint;
#else
  own = palette[int(paint.x)];
#ifdef QUICK
  own = shown(own, at, normalize(normal), normalize(toEye), clear);
#endif
#endif
  gl_Position = clip * vec4(place, 1);
}`;

const SURFACE = `
uniform sampler2D image;
uniform vec4 factor;
uniform float cut;
in vec3 at, facing, toEye, own;
in vec2 uv;
in float clear;
out vec4 ink;
void main() {
  if (at.y < -.004) discard;
  vec4 paint = vec4(own, 1);
#ifdef TEXTURED
  paint = factor * texture(image, uv);
  if (paint.a < cut) discard;
#endif
#ifndef QUICK
  vec3 normal = normalize(facing) * (gl_FrontFacing ? 1. : -1.);
  paint.rgb = shown(paint.rgb, at, normal, normalize(toEye), clear);
#endif
  ink = vec4(paint.rgb, 1);
}`;

/** The numbers of a body out of the page's data, see motet/draw/page.py. coarser: how often it was made coarser. */
function decodedBody({ rest, coarse, step, places, normals, joints, weights, parts, triangles }, coarser = 0) {
  const part = new Uint8Array(bytesOf(parts)), carriers = new Uint16Array(bytesOf(joints));
  const primitive = {
    positions: Float32Array.from(new Int16Array(bytesOf(places)), (x) => x * step),
    normals: Float32Array.from(new Int8Array(bytesOf(normals))),
    joints: carriers, weights: Float32Array.from(new Uint8Array(bytesOf(weights)), (x) => x / 255),
    parts: part, indices: new Uint32Array(bytesOf(triangles)),
  };
  const simple = coarse ? decodedBody({ rest, ...coarse }, coarser + 1) : null;
  return { rest, simple, coarser, colours: PARTS, sided: part.includes(1), joints: rest.length, influences: carriers.length / part.length, primitives: [primitive] };
}

/** A skinned mesh that was handed over, as the stage has bodies. */
function decodedAvatar({ primitives, inverseBind }) {
  const made = primitives.map((given) => ({
    ...given, normals: given.normals ?? normalsOf(given.positions, given.indices), textured: true,
    uvs: given.uvs ?? new Float32Array(2 * given.positions.length / 3),
    colour: given.colour.map((x, n) => (n < 3 ? x ** (1 / 2.2) : x)), // glTF has it linear
  }));
  return { inverseBind, joints: inverseBind.length / 16, influences: 4, primitives: made };
}

function normalsOf(places, triangles) {
  const found = new Float32Array(places.length), at = (n) => [places[3 * n], places[3 * n + 1], places[3 * n + 2]];
  for (let n = 0; n < triangles.length; n += 3) {
    const [a, b, c] = [0, 1, 2].map((k) => at(triangles[n + k]));
    const [u, v] = [b, c].map((end) => end.map((x, axis) => x - a[axis]));
    const across = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
    for (let k = 0; k < 3; k++) across.forEach((x, axis) => { found[3 * triangles[n + k] + axis] += x; });
  }
  return found;
}

/** What of a body lies on the graphics card and stays so: its images. There is room for figures once they come. */
function upload(gl, body) {
  if (body.simple) upload(gl, body.simple);
  for (const primitive of body.primitives) {
    primitive.room = null;
    if (primitive.textured) primitive.texture = textureOf(gl, primitive.image);
  }
}

/** Room for so many figures or more, one after the other. Of each corner its place, 3 floats, its normal, 3 bytes, and
 *  which colour it has, a byte. */
function roomFor(gl, primitive, count) {
  if (primitive.room?.count >= count) return primitive.room;
  if (primitive.room) vacate(gl, primitive.room);
  const { positions, indices, uvs } = primitive, size = 2 ** Math.ceil(Math.log2(count)), corners = positions.length / 3;
  const floats = new Float32Array(4 * corners * size), array = gl.createVertexArray();
  const buffers = [bufferOf(gl, gl.ARRAY_BUFFER, floats, gl.STREAM_DRAW), bufferOf(gl, gl.ELEMENT_ARRAY_BUFFER, repeated(indices, size, corners))];
  if (uvs) buffers.push(bufferOf(gl, gl.ARRAY_BUFFER, repeated(uvs, size, 0)));
  gl.bindVertexArray(array);
  gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, buffers[1]);
  gl.bindBuffer(gl.ARRAY_BUFFER, buffers[0]);
  gl.vertexAttribPointer(0, 3, gl.FLOAT, false, 16, 0);
  gl.vertexAttribPointer(1, 3, gl.BYTE, true, 16, 12);
  gl.vertexAttribPointer(2, 1, gl.UNSIGNED_BYTE, false, 16, 15);
  if (uvs) gl.bindBuffer(gl.ARRAY_BUFFER, buffers[2]);
  if (uvs) gl.vertexAttribPointer(2, 2, gl.FLOAT, false, 0, 0);
  for (let place = 0; place < 3; place++) gl.enableVertexAttribArray(place);
  gl.bindVertexArray(null);
  return (primitive.room = { count: size, array, buffers, floats, bytes: new Int8Array(floats.buffer) });
}

function vacate(gl, { array, buffers }) {
  gl.deleteVertexArray(array);
  for (const buffer of buffers) gl.deleteBuffer(buffer);
}

/** Numbers so many times over, each time with so much more. */
function repeated(values, times, more) {
  const found = new values.constructor(times * values.length);
  for (let n = 0, at = 0; n < times; n++) for (const value of values) found[at++] = value + n * more;
  return found;
}

/** Corners of figures moved by their joints' matrices (rows: 3 x 4 each, by rows) into a mesh's room. */
function moveCorners(gl, mesh, figures) {
  for (const primitive of mesh.primitives) {
    const room = roomFor(gl, primitive, figures.length), floats = 4 * primitive.positions.length / 3;
    figures.forEach(({ rows, figure }, n) => blend(primitive, rows, mesh.influences, room, n * floats, colourOf(figure)));
    gl.bindBuffer(gl.ARRAY_BUFFER, room.buffers[0]);
    gl.bufferSubData(gl.ARRAY_BUFFER, 0, room.floats, 0, figures.length * floats);
  }
}

/** Which colour of the palette a figure's body has. */
function colourOf({ colour = 0 }) {
  const own = colour % BODIES.length;
  return own && PARTS.length - 1 + own;
}

const mixed = new Float32Array(12);

/** to: where in the room a figure begins. own: the colour of its body in the palette. */
function blend({ positions, normals, joints, weights, parts }, rows, influences, { floats, bytes }, to, own) {
  for (let p = 0, k = 0; p < positions.length; p += 3, k += influences, to += 4) {
    let m = rows, i = 12 * joints[k];
    if (weights[k] !== 1) [m, i] = [mix12(rows, joints, weights, k, influences), 0];
    const x = positions[p], y = positions[p + 1], z = positions[p + 2], a = normals[p], b = normals[p + 1], c = normals[p + 2];
    const nx = m[i] * a + m[i + 1] * b + m[i + 2] * c, ny = m[i + 4] * a + m[i + 5] * b + m[i + 6] * c;
    const nz = m[i + 8] * a + m[i + 9] * b + m[i + 10] * c, scale = 127 / Math.sqrt(nx * nx + ny * ny + nz * nz || 1);
    floats[to] = m[i] * x + m[i + 1] * y + m[i + 2] * z + m[i + 3];
    floats[to + 1] = m[i + 4] * x + m[i + 5] * y + m[i + 6] * z + m[i + 7];
    floats[to + 2] = m[i + 8] * x + m[i + 9] * y + m[i + 10] * z + m[i + 11];
    bytes[4 * to + 12] = nx * scale;
    bytes[4 * to + 13] = ny * scale;
    bytes[4 * to + 14] = nz * scale;
    if (parts) bytes[4 * to + 15] = parts[p / 3] || own;
  }
}

/** The matrix of a corner that several joints carry. */
function mix12(rows, joints, weights, first, influences) {
  mixed.fill(0);
  for (let k = first; k < first + influences; k++) {
    const weight = weights[k], from = 12 * joints[k];
    if (weight) for (let i = 0; i < 12; i++) mixed[i] += weight * rows[from + i];
  }
  return mixed;
}

function textureOf(gl, image) {
  const texture = gl.createTexture();
  gl.bindTexture(gl.TEXTURE_2D, texture);
  if (image) gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, gl.RGBA, gl.UNSIGNED_BYTE, image);
  else gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, 1, 1, 0, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array([255, 255, 255, 255]));
  gl.generateMipmap(gl.TEXTURE_2D);
  gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.LINEAR_MIPMAP_LINEAR);
  return texture;
}

/** The matrices of a figure's joints (3 x 4 each, by rows), from the mesh to heights in the world. */
function rowsOf(figure) {
  const rows = new Float32Array(12 * figure.body.joints);
  if (figure.matrices) matrixRows(rows, figure.body, figure);
  else poseRows(rows, figure.body, figure);
  return rows;
}

/** Turned, scaled and moved from where the joints rest: R S (x - rest) + place. */
function poseRows(row, body, { turned, places, unit: size = 1, scales }) {
  for (let k = 0; k < body.joints; k++) {
    const [x, y, z, w] = turned[k], rest = body.rest[k], place = places[k];
    const [a, b, c] = scales?.[k] ?? [1, 1, 1], at = 12 * k;
    row[at] = a * (1 - 2 * (y * y + z * z)); row[at + 1] = b * 2 * (x * y - z * w); row[at + 2] = c * 2 * (x * z + y * w);
    row[at + 4] = a * 2 * (x * y + z * w); row[at + 5] = b * (1 - 2 * (x * x + z * z)); row[at + 6] = c * 2 * (y * z - x * w);
    row[at + 8] = a * 2 * (x * z - y * w); row[at + 9] = b * 2 * (y * z + x * w); row[at + 10] = c * (1 - 2 * (x * x + y * y));
    for (let n = 0; n < 3; n++) {
      const from = at + 4 * n;
      row[from + 3] = size * place[n] - row[from] * rest[0] - row[from + 1] * rest[1] - row[from + 2] * rest[2];
    }
  }
}

/** Joints' matrices times those that bring the mesh to the joints, columns first both. */
function matrixRows(row, { inverseBind: bind, joints }, { matrices, unit: size = 1 }) {
  for (let k = 0; k < joints; k++) {
    for (let n = 0; n < 3; n++) {
      for (let column = 0; column < 4; column++) {
        let sum = 0;
        for (let inner = 0; inner < 4; inner++) sum += matrices[16 * k + 4 * inner + n] * bind[16 * k + 4 * column + inner];
        row[12 * k + 4 * n + column] = size * sum;
      }
    }
  }
}
