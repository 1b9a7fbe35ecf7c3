export type Vector = [number, number, number];
/** Of a degree. */
export const RADIANS = Math.PI / 180;

/** Columns x, y and z. */
export type Rotation = [Vector, Vector, Vector];
/** x, y, z, w. */
export type Quaternion = [number, number, number, number];

/** The rotation of two axes, made orthogonal by Gram and Schmidt, x first. */
export function rotationOf(frame: ArrayLike<number>, at: number): Rotation {
  const axis = (from: number): Vector => [frame[from]!, frame[from + 1]!, frame[from + 2]!];
  const x = unit(axis(at));
  const y = axis(at + 3);
  const along = dot(x, y);
  const upright = unit([y[0] - along * x[0], y[1] - along * x[1], y[2] - along * x[2]]);
  return [x, upright, cross(x, upright)];
}

/** The quaternion of a rotation, w not negative; the largest part is found first, so all are exact (Shepperd 1978). */
export function quaternionOf([x, y, z]: Rotation): Quaternion {
  const trace = x[0] + y[1] + z[2];
  const diagonal = [1 - trace + 2 * x[0], 1 - trace + 2 * y[1], 1 - trace + 2 * z[2], 1 + trace];
  const a = y[2] - z[1];
  const b = z[0] - x[2];
  const c = x[1] - y[0];
  const d = x[1] + y[0];
  const e = z[0] + x[2];
  const f = y[2] + z[1];
  // each is the quaternion times four times one of its parts
  const scaled: Quaternion[] = [
    [diagonal[0]!, d, e, a],
    [d, diagonal[1]!, f, b],
    [e, f, diagonal[2]!, c],
    [a, b, c, diagonal[3]!],
  ];
  return positive(normalised(scaled[diagonal.indexOf(Math.max(...diagonal))]!));
}

/** The turn of a bone, of numbers that hold four for each. */
export function turnAt(turns: Float64Array, bone: number): Quaternion {
  const at = 4 * bone;
  return [turns[at]!, turns[at + 1]!, turns[at + 2]!, turns[at + 3]!];
}

export function setTurn(turns: Float64Array, bone: number, turn: Quaternion): void {
  const at = 4 * bone;
  turns[at] = turn[0];
  turns[at + 1] = turn[1];
  turns[at + 2] = turn[2];
  turns[at + 3] = turn[3];
}

// what follows is called thousands of times in a tick: parts are taken by index, which iterates over nothing

/** First the right turn, then the left. */
export function product(a: Quaternion, b: Quaternion): Quaternion {
  const ax = a[0];
  const ay = a[1];
  const az = a[2];
  const aw = a[3];
  const bx = b[0];
  const by = b[1];
  const bz = b[2];
  const bw = b[3];
  return [
    aw * bx + bw * ax + ay * bz - az * by,
    aw * by + bw * ay + az * bx - ax * bz,
    aw * bz + bw * az + ax * by - ay * bx,
    aw * bw - ax * bx - ay * by - az * bz,
  ];
}

export function dot(a: Vector, b: Vector): number {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

export function cross(a: Vector, b: Vector): Vector {
  return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
}

export function unit(vector: Vector): Vector {
  const length = Math.max(size(vector), 1e-12);
  return [vector[0] / length, vector[1] / length, vector[2] / length];
}

export function plus(a: Vector, b: Vector): Vector {
  return [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
}

export function minus(a: Vector, b: Vector): Vector {
  return [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
}

export function times(a: Vector, factor: number): Vector {
  return [a[0] * factor, a[1] * factor, a[2] * factor];
}

export function size(a: Vector): number {
  return Math.sqrt(dot(a, a));
}

export function mean(vectors: Vector[]): Vector {
  return times(vectors.reduce(plus, [0, 0, 0]), 1 / vectors.length);
}

/** No turn. */
export const STILL: Quaternion = [0, 0, 0, 1];

export const AXES: Rotation = [
  [1, 0, 0],
  [0, 1, 0],
  [0, 0, 1],
];
export const [X, Y, Z] = AXES;

export function normalised(q: Quaternion): Quaternion {
  const length = Math.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
  return [q[0] / length, q[1] / length, q[2] / length, q[3] / length];
}

/** The same rotation, w not negative. */
function positive(q: Quaternion): Quaternion {
  return q[3] < 0 ? [-q[0], -q[1], -q[2], -q[3]] : [q[0], q[1], q[2], q[3]];
}

export function inverse(q: Quaternion): Quaternion {
  return [-q[0], -q[1], -q[2], q[3]];
}

/** A vector turned by a rotation. */
export function rotated(q: Quaternion, vector: Vector): Vector {
  const x = q[0];
  const y = q[1];
  const z = q[2];
  const w = q[3];
  const a = vector[0];
  const b = vector[1];
  const c = vector[2];
  const u = 2 * (y * c - z * b);
  const v = 2 * (z * a - x * c);
  const t = 2 * (x * b - y * a);
  return [a + w * u + y * t - z * v, b + w * v + z * u - x * t, c + w * t + x * v - y * u];
}

/** The turn about a unit axis. */
export function about(axis: Vector, angle: number): Quaternion {
  const sine = Math.sin(angle / 2);
  return [axis[0] * sine, axis[1] * sine, axis[2] * sine, Math.cos(angle / 2)];
}

/** The rotation vector of a turn, at most half a turn long. */
export function vectorOf(q: Quaternion): Vector {
  const side = q[3] < 0 ? -1 : 1;
  const axis: Vector = [side * q[0], side * q[1], side * q[2]];
  const sine = size(axis);
  return times(axis, sine > 1e-12 ? (2 * Math.atan2(sine, side * q[3])) / sine : 2);
}

/** The same turn by the rotation vector that is nearest to another: by an angle about an axis it is also one by less a round. */
export function nearestTurn(vector: Vector, other: Vector): Vector {
  const angle = size(vector);
  const axis = angle > 1e-3 ? times(vector, 1 / angle) : times(other, 1 / Math.max(size(other), 1e-9));
  const rounds = Math.round((dot(other, axis) - angle) / (2 * Math.PI));
  return plus(vector, times(axis, 2 * Math.PI * rounds));
}

/** The turn of a rotation vector. */
export function ofVector(vector: Vector): Quaternion {
  return about(unit(vector), size(vector));
}

/** The shortest turn from one direction to another; half a turn is about any axis. */
export function swing(from: Vector, to: Vector): Quaternion {
  const start = unit(from);
  const end = unit(to);
  const cosine = dot(start, end);
  if (cosine >= -1 + 1e-6) return normalised([...cross(start, end), 1 + cosine]);
  const least = start.map(Math.abs).indexOf(Math.min(...start.map(Math.abs)));
  return [...unit(cross(start, AXES[least]!)), 0];
}

/** The part of a turn that is about an axis. */
export function twist(q: Quaternion, axis: Vector): Quaternion {
  const along = unit(axis);
  return about(along, 2 * Math.atan2(dot([q[0], q[1], q[2]], along), q[3]));
}

/** The rotation at which a share of the shortest turn to another is done. */
export function towards(from: Quaternion, to: Quaternion, share: number): Quaternion {
  return product(from, ofVector(times(vectorOf(product(inverse(from), to)), share)));
}
