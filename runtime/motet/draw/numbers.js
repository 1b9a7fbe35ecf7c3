"use strict";
// What every script here counts with; needs nothing of a browser.

const clamp = (x, low, high) => Math.min(Math.max(x, low), high);
const mix = (a, b, part) => a + (b - a) * part;
const norm = (a) => Math.sqrt(dot(a, a));
const unit = (a) => { const length = norm(a) || 1; return a.map((x) => x / length); };

function dot(a, b) {
  let sum = 0;
  for (let i = 0; i < a.length; i++) sum += a[i] * b[i];
  return sum;
}

/** The product of quaternions x, y, z, w: first the right turn, then the left. */
function product([ax, ay, az, aw], [bx, by, bz, bw]) {
  return [
    aw * bx + bw * ax + ay * bz - az * by, aw * by + bw * ay + az * bx - ax * bz,
    aw * bz + bw * az + ax * by - ay * bx, aw * bw - ax * bx - ay * by - az * bz,
  ];
}

/** A vector turned by a quaternion. */
function turnedBy([qx, qy, qz, w], [x, y, z]) {
  const [a, b, c] = [qy * z - qz * y + w * x, qz * x - qx * z + w * y, qx * y - qy * x + w * z];
  return [x + 2 * (qy * c - qz * b), y + 2 * (qz * a - qx * c), z + 2 * (qx * b - qy * a)];
}

function bytesOf(base64) {
  const letters = atob(base64), bytes = new Uint8Array(letters.length);
  for (let n = 0; n < bytes.length; n++) bytes[n] = letters.charCodeAt(n);
  return bytes.buffer;
}
