// The stage of a page: ground, figures and their shadows on a canvas, as sharp as the machine draws them in time.

const SUN = unit([0.42, 1, 0.5]), REACH = 7, CAST_REACH = 12;
const THEMES = {
  light: { fog: [226, 230, 237], sky: [246, 248, 251], light: [240, 242, 246], dark: [218, 223, 232], shade: 0.42, night: 0 },
  dark: { fog: [30, 34, 42], sky: [18, 20, 26], light: [62, 68, 80], dark: [50, 55, 66], shade: 0.6, night: 1 },
};
/** From sharp to fast: at most how many pixels of the screen for one of the page, the size of the shadow map, how often it
 *  is looked at, up to how many pixels the coarser bodies are fine enough, how many figures cast a shadow, and
 *  whether bodies are lit at their corners alone. */
const QUALITIES = [
  { ratio: 2, map: 2048, taps: 8, sizes: [160, 40], casters: 100 }, { ratio: 1, map: 1024, taps: 8, sizes: [180, 40], casters: 100 },
  { ratio: 1, map: 1024, taps: 2, sizes: [320, 60], casters: 16, quick: true }, { ratio: 1, map: 512, taps: 1, sizes: [320, 60], casters: 12, quick: true },
  { ratio: 0.8, map: 512, taps: 1, sizes: [320, 70], casters: 8, quick: true }, { ratio: 0.6, map: 512, taps: 1, sizes: [400, 70], casters: 6, quick: true },
];

/** Vertex and fragment shaders. */
const PROGRAMS = {
  shadow: [CAST, SHADOW_ONLY], sky: [SKY, PLAIN], ground: [GROUND, CHECKS], shade: [SHADED, SHADE + SHADOW], marks: [MARKS, MARK],
  body: [SHADE + LIGHT + CORNERS, SHADE + LIGHT + SURFACE],
};

/** The stage of a canvas; null where the browser cannot draw it, which the page then says. */
function openStage(canvas) {
  const gl = contextOf(canvas);
  return gl && new Stage(canvas, gl);
}

class Stage {
  constructor(canvas, gl) {
    Object.assign(this, { canvas, gl, bodies: new Set(), lost: false, least: gl.getContextAttributes().antialias ? (window.devicePixelRatio > 1 ? 0 : 1) : 2 });
    this.quality = this.least;
    this.pace = { last: 0, mean: 16, time: 0, patience: 6000 }; // milliseconds
    canvas.addEventListener("webglcontextlost", (event) => { event.preventDefault(); this.lost = true; });
    canvas.addEventListener("webglcontextrestored", () => { this.lost = false; this.prepare(); view.dirty = true; });
    this.prepare();
  }

  /** All that lies on the graphics card, at first and after it was lost. */
  prepare() {
    const { gl } = this;
    this.programs = {};
    this.shadows = null;
    this.marks = streamOf(gl, [4, 4, 1]);
    this.shades = streamOf(gl, [2]);
    this.white = textureOf(gl, null);
    for (const body of this.bodies) upload(gl, body);
    this.level = QUALITIES[this.quality];
    for (const name of Object.keys(PROGRAMS)) this.start(name, name === "body" ? this.lit(true) : {});
  }

  body(data) {
    return this.keep(decodedBody(data));
  }

  avatar(data) {
    return this.keep(decodedAvatar(data));
  }

  keep(body) {
    if (!this.lost) upload(this.gl, body);
    this.bodies.add(body);
    return body;
  }

  drop(body) {
    const { gl } = this;
    if (body.simple) this.drop(body.simple);
    this.bodies.delete(body);
    for (const { room, texture } of body.primitives) {
      if (room) vacate(gl, room);
      gl.deleteTexture(texture ?? null);
    }
  }

  /** A program at the quality of now. */
  program(name, defined = {}) {
    const started = this.start(name, defined);
    return started.places ? started : Object.assign(started, { places: placesOf(this.gl, started.program) });
  }

  /** Let a program be compiled, beside what else is done. */
  start(name, defined = {}) {
    const { taps } = this.level, key = `${name} ${taps} ${JSON.stringify(defined)}`;
    return (this.programs[key] ??= { program: programOf(this.gl, ...PROGRAMS[name], { TAPS: taps, ...defined }) });
  }

  /** Before the boxes of a frame: the canvas gets its size. Its size in pixels of the page, 0 where nothing is seen.
   *  still: the picture stays for a while, and is drawn as well as it can be. */
  begin(still = false) {
    const { canvas, gl } = this, width = canvas.clientWidth, height = canvas.clientHeight;
    if (this.lost || gl.isContextLost() || !width || !height) return { width: 0, height: 0 };
    if (!still) this.adapt(performance.now());
    this.level = QUALITIES[still ? Math.min(this.least, 1) : this.quality];
    const ratio = Math.min(window.devicePixelRatio || 1, this.level.ratio);
    const size = [width, height].map((x) => Math.max(1, Math.round(x * ratio)));
    if (canvas.width !== size[0] || canvas.height !== size[1]) [canvas.width, canvas.height] = size;
    this.ratio = size[1] / height;
    gl.clearColor(...rgb(THEMES[isDark() ? "dark" : "light"].fog), 1);
    gl.clear(gl.COLOR_BUFFER_BIT);
    return { width, height };
  }

  /** Coarser if frames are slow for half a second, finer if they are quick for long; a pause counts for nothing. */
  adapt(now) {
    const { pace } = this, passed = now - pace.last;
    pace.last = now;
    if (passed > 2500 || passed <= 0) return;
    pace.mean += (passed - pace.mean) * clamp(passed / 250, 0.05, 0.5);
    pace.time += passed;
    const step = pace.mean > 20 && pace.time > 500 ? (pace.mean > 90 ? 2 : 1) : pace.mean < 17.5 && pace.time > pace.patience ? -1 : 0;
    const quality = clamp(this.quality + step, this.least, QUALITIES.length - 1);
    if (!step || quality === this.quality) return;
    if (step > 0) pace.patience = Math.min(2 * pace.patience, 300000);
    this.quality = quality;
    Object.assign(pace, { time: 0, mean: 20 });
  }

  /** Draw figures, strips and spots as a camera sees them, in a box of the canvas (pixels of the page), or all of it. */
  draw(camera, { figures = [], strips = [], spots = [] }, box) {
    const { gl, canvas, ratio } = this;
    if (this.lost || gl.isContextLost()) return;
    const { x, y, width, height } = box ?? { x: 0, y: 0, width: canvas.clientWidth, height: canvas.clientHeight };
    const area = [x, canvas.height / ratio - y - height, width, height].map((part) => Math.round(part * ratio));
    const theme = THEMES[isDark() ? "dark" : "light"], { groups, casters } = this.pose(figures, camera);
    const paint = [...rgb(theme.dark).map((x) => 0.85 * x), 1];
    for (const { body, isGround } of figures) if (isGround) for (const part of body.primitives) part.colour = paint;
    const shared = { ...sharedBy(camera, width, height, theme), ...this.castShadows(groups, casters, camera) };
    gl.viewport(...area);
    gl.enable(gl.SCISSOR_TEST);
    gl.scissor(...area);
    gl.clear(gl.DEPTH_BUFFER_BIT);
    gl.activeTexture(gl.TEXTURE1);
    gl.bindTexture(gl.TEXTURE_2D, this.shadows.texture);
    this.drawGround(shared, theme, height, casters);
    this.drawMarks(shared, figures, strips, spots, theme);
    this.drawFigures(groups, shared);
    gl.disable(gl.SCISSOR_TEST);
  }

  /** Move the corners of figures: of each into the mesh that is seen, if any is, and into the one that casts its shadow,
   *  if it is near. Each mesh is a group with figures, of which so many are only seen, and so many are only shadows. */
  pose(figures, camera) {
    const { sizes, casters: most, quick } = this.level, groups = new Map(), casters = [];
    const far = ([x, , z]) => Math.hypot(x - camera.target[0], z - camera.target[2]);
    const placed = figures.map((figure) => ({ figure, root: rootOf(figure), away: far(rootOf(figure)) }));
    const put = (mesh, kind, one) => groups.set(mesh, groups.get(mesh) ?? [[], [], []]).get(mesh)[kind].push(one);
    placed.sort((a, b) => a.away - b.away).forEach(({ figure, root, away }, order) => {
      const { body } = figure, size = project(camera, root).scale * this.ratio;
      const shown = figure.isGround || inSight(camera, root) ? simpler(body, sizes.filter((least) => size < least).length) : null;
      const cast = !figure.isGround && order < most && away < CAST_REACH ? simpler(body, quick ? 2 : 1) : null;
      if (!shown && !cast) return;
      const one = { figure, root, rows: rowsOf(figure) };
      if (cast) casters.push(one);
      if (shown) put(shown, shown === cast ? 1 : 0, one);
      if (cast && cast !== shown) put(cast, 2, one);
    });
    return { casters, groups: [...groups].map(([mesh, kinds]) => {
      moveCorners(this.gl, mesh, kinds.flat());
      const [seen, both, shadows] = kinds.map(({ length }) => length);
      return { mesh, seen, shadows, count: seen + both + shadows };
    }) };
  }

  /** The figures as the sun sees them; what the light is looked up with. */
  castShadows(groups, casters, camera) {
    const { gl } = this, { map: size } = this.level, sees = sunBox(casters, camera);
    if (this.shadows?.size !== size) this.shadows = shadowMap(gl, size, this.shadows);
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.shadows.frame);
    gl.viewport(0, 0, size, size);
    gl.enable(gl.DEPTH_TEST);
    gl.clear(gl.DEPTH_BUFFER_BIT);
    gl.enable(gl.POLYGON_OFFSET_FILL);
    gl.polygonOffset(1.5, 3);
    use(gl, this.program("shadow"), { clip: sees.clip });
    for (const { mesh, seen, count } of groups) this.triangles(mesh, seen, count);
    gl.disable(gl.POLYGON_OFFSET_FILL);
    gl.disable(gl.DEPTH_TEST);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    return { sunClip: sees.clip, softness: Math.max(0.006 / sees.radius, 1.2 / size), grain: 0.0008 };
  }

  /** Sky and ground, and over it the shadows where they may lie: to look for them takes most of the time. */
  drawGround(shared, theme, height, casters) {
    const { gl } = this, pixel = 2 * shared.tall / height / this.ratio;
    gl.bindVertexArray(null);
    use(gl, this.program("sky"), shared);
    gl.drawArrays(gl.TRIANGLES, 0, 6 * SKY_ROWS);
    const own = { light: rgb(theme.light), dark: rgb(theme.dark), sharp: 4 * shared.eye[1] / pixel / FINE };
    use(gl, this.program("ground"), { ...shared, ...own });
    gl.drawArrays(gl.TRIANGLES, 0, 6 * SECTORS * RINGS);
    const boxes = casters.flatMap(({ figure }) => shadeOf(figure));
    this.blended(() => {
      use(gl, this.program("shade"), { ...shared, shade: theme.shade, shadows: { int: 1 } });
      drawStream(gl, this.shades, covered(boxes));
    });
  }

  /** Draw over what is there, by how clear it is. */
  blended(draw) {
    const { gl } = this;
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);
    draw();
    gl.disable(gl.BLEND);
  }

  drawMarks(shared, figures, strips, spots, theme) {
    const { gl } = this, marks = new Marks();
    for (const strip of strips) marks.strip(strip);
    for (const figure of figures) if (!figure.isGround) darken(marks, figure, 0.5 * theme.shade);
    for (const spot of spots) marks.spot(spot);
    this.blended(() => {
      use(gl, this.program("marks"), shared);
      drawStream(gl, this.marks, marks.made());
    });
  }

  /** What says how bodies of people are lit; shaded: whether shadows fall on them where it has to be quick. */
  lit(shaded) {
    return this.level.quick ? { QUICK: 1, TAPS: shaded ? 1 : 0 } : {};
  }

  drawFigures(groups, shared) {
    const { gl } = this;
    gl.enable(gl.DEPTH_TEST);
    for (const { mesh, shadows, count } of groups) {
      if (shadows === count) continue;
      const program = this.program("body", mesh.primitives[0].textured ? { TEXTURED: 1 } : this.lit(mesh.coarser < 2));
      use(gl, program, { ...shared, shadows: { int: 1 }, image: { int: 2 } });
      gl.uniform3fv(program.places["palette[0]"] ?? null, PALETTE);
      this.triangles(mesh, 0, count - shadows, program.places);
    }
    gl.disable(gl.DEPTH_TEST);
  }

  /** The figures of a mesh from one to another. places: of the uniforms that its materials have. */
  triangles(mesh, from, to, places = {}) {
    const { gl } = this;
    if (from < to) for (const { room, indices, texture, colour = [1, 1, 1, 1], cut = 0, twoSided } of mesh.primitives) {
      gl[twoSided ? "disable" : "enable"](gl.CULL_FACE);
      if (texture && places.factor) {
        gl.activeTexture(gl.TEXTURE2);
        gl.bindTexture(gl.TEXTURE_2D, texture);
        gl.uniform4fv(places.factor, colour);
        gl.uniform1f(places.cut, cut);
      }
      gl.bindVertexArray(room.array);
      gl.drawElements(gl.TRIANGLES, (to - from) * indices.length, gl.UNSIGNED_INT, 4 * from * indices.length);
    }
    gl.disable(gl.CULL_FACE);
  }
}

/** A body, or the coarser one of it, so many times over. */
const simpler = (body, times) => (times && body.simple ? simpler(body.simple, times - 1) : body);

/** Whether some of a figure may be seen: what is within a height of its root. */
function inSight(camera, root) {
  const { x, y, depth, scale } = project(camera, root);
  return depth > -1 && (depth < 1 || (Math.abs(x - camera.x) < camera.x + scale && Math.abs(y - camera.y) < camera.y + scale));
}

const rgb = (colour) => colour.map((x) => x / 255);

/** What programs know of the camera and the theme. */
function sharedBy(camera, width, height, theme) {
  const { target, right, up, toward, distance, focal } = camera;
  const eye = target.map((x, n) => x + distance * toward[n]), reach = REACH + distance;
  const rows = [right, up, toward].map((axis) => [...axis, -dot(axis, target)]);
  const [near, far] = [0.05, 200], slope = (far + near) / (far - near), shift = -2 * far * near / (far - near);
  const depth = rows[2].map((x, n) => -x + (n === 3 ? distance : 0));
  const flat = [rows[0].map((x) => x * 2 * focal / width), rows[1].map((x) => x * 2 * focal / height),
    depth.map((x, n) => slope * x + (n === 3 ? shift : 0)), depth];
  const clip = Float32Array.from({ length: 16 }, (_, n) => flat[n % 4][Math.floor(n / 4)]);
  const { fog, sky, night } = theme;
  return {
    clip, eye, target, right, up, toward, reach, night, middle: target, sun: SUN, fog: rgb(fog), sky: rgb(sky),
    tall: height / 2 / focal, wide: width / 2 / focal,
  };
}

/** A box along the sun's rays around figures. */
function sunBox(slots, camera) {
  const roots = slots.map(({ root }) => root);
  const [low, high] = [Math.min, Math.max].map((end) => [0, 2].map((axis) => end(...roots.map((root) => root[axis]))));
  const middle = roots.length ? [(low[0] + high[0]) / 2, 0.4, (low[1] + high[1]) / 2] : camera.target;
  const radius = 1.05 + (roots.length ? Math.hypot(high[0] - low[0], high[1] - low[1]) / 2 : 0);
  const side = unit([SUN[2], 0, -SUN[0]]);
  const upward = [SUN[1] * side[2], SUN[2] * side[0] - SUN[0] * side[2], -SUN[1] * side[0]];
  const rows = [side, upward, SUN.map((x) => -x)].map((axis, n) => {
    const size = n === 2 ? radius + 1 : radius;
    return [...axis.map((x) => x / size), -dot(axis, middle) / size];
  });
  rows.push([0, 0, 0, 1]);
  return { radius, middle, clip: Float32Array.from({ length: 16 }, (_, n) => rows[n % 4][Math.floor(n / 4)]) };
}

/** Where a figure is, in heights. */
const rootOf = ({ places, unit: size = 1 }) => places[0].map((x) => x * size);

/** Boxes on the ground, from [x, z] to [x, z], in which a figure's shadow lies: around each joint of people, whose bones
 *  are short, and around all of other bodies. */
function shadeOf({ body, places, unit: size = 1 }) {
  const spots = places.map(([x, y, z]) => [size * (x - y * SUN[0] / SUN[1]), size * (z - y * SUN[2] / SUN[1])]);
  const end = (of) => [0, 1].map((axis) => of(...spots.map((spot) => spot[axis])));
  return body.simple || body.inverseBind ? spots.map((spot) => [spot, spot]) : [[end(Math.min), end(Math.max)]];
}

function shadowMap(gl, size, before) {
  if (before) {
    gl.deleteTexture(before.texture);
    gl.deleteFramebuffer(before.frame);
  }
  const texture = gl.createTexture(), frame = gl.createFramebuffer();
  gl.activeTexture(gl.TEXTURE1);
  gl.bindTexture(gl.TEXTURE_2D, texture);
  gl.texStorage2D(gl.TEXTURE_2D, 1, gl.DEPTH_COMPONENT24, size, size);
  gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_COMPARE_MODE, gl.COMPARE_REF_TO_TEXTURE);
  for (const filter of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(gl.TEXTURE_2D, filter, gl.LINEAR);
  for (const side of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T]) gl.texParameteri(gl.TEXTURE_2D, side, gl.CLAMP_TO_EDGE);
  gl.bindFramebuffer(gl.FRAMEBUFFER, frame);
  gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.DEPTH_ATTACHMENT, gl.TEXTURE_2D, texture, 0);
  gl.bindFramebuffer(gl.FRAMEBUFFER, null);
  return { size, texture, frame };
}
