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

function bytesOf(base64) {
  return Uint8Array.from(atob(base64), (letter) => letter.charCodeAt(0)).buffer;
}
