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

/** The quaternion of a rotation, w not negative. */
export function quaternionOf([x, y, z]: Rotation): Quaternion {
  const size = (a: number) => Math.sqrt(Math.max(a, 0)) / 2;
  const w = size(1 + x[0] + y[1] + z[2]);
  const signed = (a: number, sign: number) => (sign < 0 ? -size(a) : size(a));
  return [
    signed(1 + x[0] - y[1] - z[2], y[2] - z[1]),
    signed(1 - x[0] + y[1] - z[2], z[0] - x[2]),
    signed(1 - x[0] - y[1] + z[2], x[1] - y[0]),
    w,
  ];
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
