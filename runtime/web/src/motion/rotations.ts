export type Vector = [number, number, number];
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

/** First the right turn, then the left. */
export function product([ax, ay, az, aw]: Quaternion, [bx, by, bz, bw]: Quaternion): Quaternion {
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
  const length = Math.max(Math.hypot(...vector), 1e-12);
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
  return Math.hypot(a[0], a[1], a[2]);
}

export function mean(vectors: Vector[]): Vector {
  return times(vectors.reduce(plus, [0, 0, 0]), 1 / vectors.length);
}

/** No turn. */
export const STILL: Quaternion = [0, 0, 0, 1];

export const [X, Y, Z]: Rotation = [
  [1, 0, 0],
  [0, 1, 0],
  [0, 0, 1],
];

export function normalised(q: Quaternion): Quaternion {
  const length = Math.hypot(...q);
  return [q[0] / length, q[1] / length, q[2] / length, q[3] / length];
}

/** The same rotation, w not negative. */
export function positive([x, y, z, w]: Quaternion): Quaternion {
  return w < 0 ? [-x, -y, -z, -w] : [x, y, z, w];
}

export function inverse([x, y, z, w]: Quaternion): Quaternion {
  return [-x, -y, -z, w];
}

/** A vector turned by a rotation. */
export function rotated([x, y, z, w]: Quaternion, [a, b, c]: Vector): Vector {
  const p = 2 * (y * c - z * b);
  const q = 2 * (z * a - x * c);
  const r = 2 * (x * b - y * a);
  return [a + w * p + y * r - z * q, b + w * q + z * p - x * r, c + w * r + x * q - y * p];
}

/** The turn about a unit axis. */
export function about(axis: Vector, angle: number): Quaternion {
  const sine = Math.sin(angle / 2);
  return [axis[0] * sine, axis[1] * sine, axis[2] * sine, Math.cos(angle / 2)];
}

/** The rotation vector of a turn, at most half a turn long. */
export function vectorOf(q: Quaternion): Vector {
  const [x, y, z, w] = positive(q);
  const sine = Math.hypot(x, y, z);
  return times([x, y, z], sine > 1e-12 ? (2 * Math.atan2(sine, w)) / sine : 2);
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
  return [...unit(cross(start, [X, Y, Z][least]!)), 0];
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
