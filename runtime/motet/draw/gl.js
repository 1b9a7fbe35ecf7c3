// WebGL2: programs and buffers, and what is said where a browser has none.

const NO_WEBGL = "This browser cannot draw the figures: it has no WebGL 2. Update it, or turn on its hardware acceleration.";

/** The WebGL2 context of a canvas; where there is none, null, and the page says so. Smooth edges cost too much where a
 *  program stands in for the graphics card. */
function contextOf(canvas) {
  const probe = document.createElement("canvas").getContext("webgl2"), names = probe?.getExtension("WEBGL_debug_renderer_info");
  const software = names && /swiftshader|llvmpipe|software/i.test(probe.getParameter(names.UNMASKED_RENDERER_WEBGL));
  probe?.getExtension("WEBGL_lose_context")?.loseContext();
  const gl = canvas.getContext("webgl2", { alpha: false, antialias: !software, powerPreference: "high-performance" });
  if (gl) return gl;
  const said = element("p", canvas.parentElement, "stop");
  said.textContent = NO_WEBGL;
  said.setAttribute("role", "alert");
  return null;
}

/** A program, which is compiled from now on. defined: names for #define with their values. */
function programOf(gl, vertex, fragment, defined = {}) {
  const program = gl.createProgram();
  const names = Object.entries(defined).map(([name, value]) => `#define ${name} ${value}\n`).join("");
  const head = `#version 300 es\n${names}precision highp float;\nprecision highp int;\nprecision mediump sampler2DShadow;\n`;
  for (const [kind, text] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, head + text);
    gl.compileShader(shader);
    gl.attachShader(program, shader);
  }
  gl.linkProgram(program);
  return program;
}

/** The places of a program's uniforms by name, once it is compiled. */
function placesOf(gl, program) {
  if (!gl.getProgramParameter(program, gl.LINK_STATUS) && !gl.isContextLost()) {
    const logs = gl.getAttachedShaders(program).map((shader) => gl.getShaderInfoLog(shader));
    throw new Error(`${gl.getProgramInfoLog(program)} ${logs.join(" ")}`);
  }
  const places = {};
  for (let n = 0; n < gl.getProgramParameter(program, gl.ACTIVE_UNIFORMS); n++) {
    const { name } = gl.getActiveUniform(program, n);
    places[name] = gl.getUniformLocation(program, name);
  }
  return places;
}

/** Start a program and set its uniforms by name: numbers, whole ones as {int}, vectors, matrices (16 numbers). */
function use(gl, { program, places }, uniforms) {
  gl.useProgram(program);
  for (const [name, value] of Object.entries(uniforms)) {
    const place = places[name];
    if (place === undefined) continue;
    if (typeof value === "number") gl.uniform1f(place, value);
    else if (value.int !== undefined) gl.uniform1i(place, value.int);
    else if (value.length === 16) gl.uniformMatrix4fv(place, false, value);
    else gl[`uniform${value.length}fv`](place, value);
  }
}

function bufferOf(gl, kind, values, use_ = gl.STATIC_DRAW) {
  const buffer = gl.createBuffer();
  gl.bindVertexArray(null);
  gl.bindBuffer(kind, buffer);
  gl.bufferData(kind, values, use_);
  return buffer;
}

/** Corners that are new in every picture. sizes: of their attributes, in numbers. */
function streamOf(gl, sizes) {
  const array = gl.createVertexArray(), buffer = gl.createBuffer(), all = sizes.reduce((sum, size) => sum + size, 0);
  gl.bindVertexArray(array);
  gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
  sizes.forEach((size, place) => {
    gl.enableVertexAttribArray(place);
    gl.vertexAttribPointer(place, size, gl.FLOAT, false, 4 * all, 4 * sizes.slice(0, place).reduce((sum, before) => sum + before, 0));
  });
  gl.bindVertexArray(null);
  return { array, buffer, all };
}

/** Draw triangles of corners, one after the other. */
function drawStream(gl, { array, buffer, all }, numbers) {
  gl.bindVertexArray(array);
  gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
  gl.bufferData(gl.ARRAY_BUFFER, numbers, gl.STREAM_DRAW);
  gl.drawArrays(gl.TRIANGLES, 0, numbers.length / all);
}
