// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// A small viewer for one face: mesh with morph targets and texture, turned by mouse, touch or keys, drawn by WebGL 1.
//
//   createViewer(container, data)
//
// `data` is the object written by viewer_json (C++). Model space is GL's eye space of a frontal face: x to the subject's
// left (right in the picture), y up, z out of the face, mm. The container's attribute data-viewer says how it went:
// "ready", "no-webgl" or "error".
'use strict';

const VERTEX_SHADER = `
attribute vec3 position;
attribute vec3 normal;
attribute vec2 uv;
attribute vec3 color;
uniform mat4 eyeFromModel;
uniform mat4 clipFromEye;
varying vec3 eyeNormal;
varying vec3 eyePoint;
varying vec2 texturePoint;
varying vec3 vertexColor;
void main() {
  vec4 point = eyeFromModel * vec4(position, 1.0);
  eyePoint = point.xyz;
  eyeNormal = mat3(eyeFromModel) * normal;
  texturePoint = uv;
  vertexColor = color;
  gl_Position = clipFromEye * point;
}`;

const FRAGMENT_SHADER = `
precision mediump float;
uniform sampler2D picture;
uniform float textured;    // 1: texture, 0: clay
uniform float lit;         // 1: shaded, 0: colours as they are
uniform vec4 lineColor;    // alpha 1: draw lines in this colour
varying vec3 eyeNormal;
varying vec3 eyePoint;
varying vec2 texturePoint;
varying vec3 vertexColor;
void main() {
  if (lineColor.a > 0.0) { gl_FragColor = vec4(lineColor.rgb, 1.0); return; }
  vec3 n = normalize(eyeNormal);
  vec3 toEye = normalize(-eyePoint);
  vec4 texel = texture2D(picture, texturePoint);
  vec3 base = mix(vertexColor, mix(vertexColor, texel.rgb, texel.a), textured);
  if (!gl_FrontFacing) { gl_FragColor = vec4(base * 0.28, 1.0); return; }
  float key = max(dot(n, normalize(vec3(-0.45, 0.55, 0.75))), 0.0);
  float fill = max(dot(n, normalize(vec3(0.8, 0.05, 0.55))), 0.0);
  float sky = 0.5 + 0.5 * n.y;
  float rim = pow(1.0 - max(dot(n, toEye), 0.0), 3.0);
  float shine = pow(max(dot(n, normalize(normalize(vec3(-0.45, 0.55, 0.75)) + toEye)), 0.0), 24.0);
  vec3 light = vec3(0.70, 0.68, 0.66) * key + vec3(0.16, 0.18, 0.22) * fill + vec3(0.26, 0.28, 0.31) * sky;
  vec3 shaded = base * light + vec3(0.10) * rim + vec3(0.10) * shine * (1.0 - 0.6 * textured);
  gl_FragColor = vec4(mix(base, shaded, lit), 1.0);
}`;

function decodeBase64(text, Type) {
  const characters = atob(text);
  const bytes = new Uint8Array(characters.length);
  for (let i = 0; i < bytes.length; ++i) bytes[i] = characters.charCodeAt(i);
  return new Type(bytes.buffer);
}

// Area-weighted vertex normals (V x 3).
function vertexNormals(points, corners) {
  const normals = new Float32Array(points.length);
  for (let t = 0; t < corners.length; t += 3) {
    const a = 3 * corners[t], b = 3 * corners[t + 1], c = 3 * corners[t + 2];
    const ux = points[b] - points[a], uy = points[b + 1] - points[a + 1], uz = points[b + 2] - points[a + 2];
    const vx = points[c] - points[a], vy = points[c + 1] - points[a + 1], vz = points[c + 2] - points[a + 2];
    const n = [uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx];
    for (const v of [a, b, c]) for (let i = 0; i < 3; ++i) normals[v + i] += n[i];
  }
  return normals;
}

// Row-major 3 x 3 matrices as arrays of nine.
function multiply3(a, b) {
  const result = new Array(9).fill(0);
  for (let i = 0; i < 3; ++i)
    for (let j = 0; j < 3; ++j)
      for (let k = 0; k < 3; ++k) result[3 * i + j] += a[3 * i + k] * b[3 * k + j];
  return result;
}

const turnAboutX = (a) => [1, 0, 0, 0, Math.cos(a), -Math.sin(a), 0, Math.sin(a), Math.cos(a)];
const turnAboutY = (a) => [Math.cos(a), 0, Math.sin(a), 0, 1, 0, -Math.sin(a), 0, Math.cos(a)];
const IDENTITY = [1, 0, 0, 0, 1, 0, 0, 0, 1];

// The face's vertices under morph target values, and what the GPU needs of them.
class MorphedFace {
  constructor(data) {
    this.neutral = decodeBase64(data.vertices, Float32Array);
    this.vertexOf = decodeBase64(data.vertexOf, Uint32Array);
    this.uv = decodeBase64(data.uv, Float32Array);
    this.triangles = decodeBase64(data.triangles, Uint32Array);
    this.colors = data.colors ? decodeBase64(data.colors, Float32Array) : null;
    this.targets = data.targets.map((t) => ({
      name: t.name, fitted: t.value, scale: t.scale, offsets: decodeBase64(t.offsets, Int16Array),
    }));
    this.values = new Float32Array(this.targets.map((t) => t.fitted));
    this.corners = this.triangles.map((renderVertex) => this.vertexOf[renderVertex]);
    const low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
    this.neutral.forEach((x, i) => {
      low[i % 3] = Math.min(low[i % 3], x);
      high[i % 3] = Math.max(high[i % 3], x);
    });
    this.center = low.map((x, i) => (x + high[i]) / 2);
    this.radius = Math.hypot(...low.map((x, i) => high[i] - x)) / 2 || 1;
  }

  morphed() {
    const points = this.neutral.slice();
    this.targets.forEach((target, k) => {
      const factor = this.values[k] * target.scale;
      if (factor !== 0) for (let i = 0; i < points.length; ++i) points[i] += factor * target.offsets[i];
    });
    return points;
  }

  // Three numbers a vertex to three numbers a render vertex.
  spread(perVertex) {
    const result = new Float32Array(3 * this.vertexOf.length);
    for (let r = 0; r < this.vertexOf.length; ++r)
      for (let i = 0; i < 3; ++i) result[3 * r + i] = perVertex[3 * this.vertexOf[r] + i];
    return result;
  }

  // Index pairs of every edge once.
  edges() {
    const seen = new Set();
    const result = [];
    for (let t = 0; t < this.triangles.length; t += 3) {
      for (let i = 0; i < 3; ++i) {
        const a = this.triangles[t + i], b = this.triangles[t + (i + 1) % 3];
        const u = this.vertexOf[a], v = this.vertexOf[b];
        const key = Math.min(u, v) * this.neutral.length + Math.max(u, v);
        if (!seen.has(key)) { seen.add(key); result.push(a, b); }
      }
    }
    return new Uint32Array(result);
  }
}

// Draws a MorphedFace into a canvas.
class FaceRenderer {
  constructor(gl, face, textureAddress, onChange) {
    this.gl = gl;
    this.face = face;
    if (!gl.getExtension('OES_element_index_uint')) throw new Error('WebGL lacks 32-bit indices');
    this.program = this.link();
    gl.useProgram(this.program);
    this.uniform = {};
    for (const name of ['eyeFromModel', 'clipFromEye', 'picture', 'textured', 'lit', 'lineColor'])
      this.uniform[name] = gl.getUniformLocation(this.program, name);
    this.positions = this.attribute('position', 3, null);
    this.normals = this.attribute('normal', 3, null);
    this.attribute('uv', 2, face.uv);
    this.attribute('color', 3, face.colors ? face.spread(face.colors)
                                           : new Float32Array(3 * face.vertexOf.length).fill(0.72));
    this.surface = this.indices(face.triangles);
    this.edgeIndices = face.edges();
    this.lines = this.indices(this.edgeIndices);
    gl.bindTexture(gl.TEXTURE_2D, gl.createTexture());
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, 1, 1, 0, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array([0, 0, 0, 0]));
    if (textureAddress) this.loadTexture(textureAddress, onChange);
    gl.enable(gl.DEPTH_TEST);
    gl.enable(gl.POLYGON_OFFSET_FILL);
    gl.polygonOffset(1, 1);
    this.update();
  }

  link() {
    const gl = this.gl;
    const program = gl.createProgram();
    for (const [type, source] of [[gl.VERTEX_SHADER, VERTEX_SHADER], [gl.FRAGMENT_SHADER, FRAGMENT_SHADER]]) {
      const shader = gl.createShader(type);
      gl.shaderSource(shader, source);
      gl.compileShader(shader);
      if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader) || 'shader');
      gl.attachShader(program, shader);
    }
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(program) || 'program');
    return program;
  }

  attribute(name, size, values) {
    const gl = this.gl;
    const buffer = gl.createBuffer();
    gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
    if (values) gl.bufferData(gl.ARRAY_BUFFER, values, gl.STATIC_DRAW);
    const location = gl.getAttribLocation(this.program, name);
    gl.enableVertexAttribArray(location);
    gl.vertexAttribPointer(location, size, gl.FLOAT, false, 0, 0);
    return buffer;
  }

  indices(values) {
    const buffer = this.gl.createBuffer();
    this.gl.bindBuffer(this.gl.ELEMENT_ARRAY_BUFFER, buffer);
    this.gl.bufferData(this.gl.ELEMENT_ARRAY_BUFFER, values, this.gl.STATIC_DRAW);
    return buffer;
  }

  loadTexture(address, onChange) {
    const image = new Image();
    image.onload = () => {
      const gl = this.gl;
      gl.pixelStorei(gl.UNPACK_PREMULTIPLY_ALPHA_WEBGL, false);
      gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, gl.RGBA, gl.UNSIGNED_BYTE, image);
      gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_S, gl.CLAMP_TO_EDGE);
      gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_T, gl.CLAMP_TO_EDGE);
      gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAG_FILTER, gl.LINEAR);
      gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.LINEAR);
      onChange();
    };
    image.src = address;
  }

  // To be called when the face's values have changed.
  update() {
    const gl = this.gl;
    const points = this.face.morphed();
    for (const [buffer, values] of [[this.positions, points], [this.normals, vertexNormals(points, this.face.corners)]]) {
      gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
      gl.bufferData(gl.ARRAY_BUFFER, this.face.spread(values), gl.DYNAMIC_DRAW);
    }
  }

  draw(rotation, distance, shift, look) {
    const gl = this.gl;
    const { width, height } = gl.canvas;
    const r = rotation, c = this.face.center;
    const move = [0, 1, 2].map((i) => -(r[3 * i] * c[0] + r[3 * i + 1] * c[1] + r[3 * i + 2] * c[2]));
    const near = Math.max(distance - 3 * this.face.radius, 0.02 * distance), far = distance + 3 * this.face.radius;
    const f = 1 / Math.tan(0.5 * VIEW_ANGLE), aspect = width / height;
    const fx = aspect >= 1 ? f / aspect : f, fy = aspect >= 1 ? f : f * aspect;
    gl.viewport(0, 0, width, height);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.uniformMatrix4fv(this.uniform.eyeFromModel, false, [
      r[0], r[3], r[6], 0, r[1], r[4], r[7], 0, r[2], r[5], r[8], 0,
      move[0] + shift[0], move[1] + shift[1], move[2] - distance, 1]);
    gl.uniformMatrix4fv(this.uniform.clipFromEye, false, [
      fx, 0, 0, 0, 0, fy, 0, 0, 0, 0, (far + near) / (near - far), -1, 0, 0, 2 * far * near / (near - far), 0]);
    gl.uniform1f(this.uniform.textured, look.surface === 'texture' ? 1 : 0);
    gl.uniform1f(this.uniform.lit, look.surface === 'texture' && !look.lit ? 0 : 1);
    gl.uniform4f(this.uniform.lineColor, 0, 0, 0, 0);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, this.surface);
    gl.drawElements(gl.TRIANGLES, this.face.triangles.length, gl.UNSIGNED_INT, 0);
    if (look.wireframe) {
      gl.uniform4f(this.uniform.lineColor, 0.05, 0.35, 0.6, 1);
      gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, this.lines);
      gl.drawElements(gl.LINES, this.edgeIndices.length, gl.UNSIGNED_INT, 0);
    }
  }
}

const VIEW_ANGLE = 0.42;

// Orbit by mouse, touch and keys; calls onChange after each change.
class OrbitControl {
  constructor(canvas, radius, onChange) {
    this.home = 0.84 * radius / Math.sin(0.5 * VIEW_ANGLE);
    this.onChange = onChange;
    this.pointers = new Map();
    this.reset();
    canvas.addEventListener('pointerdown', (e) => {
      canvas.setPointerCapture(e.pointerId);
      this.pointers.set(e.pointerId, [e.clientX, e.clientY]);
    });
    for (const end of ['pointerup', 'pointercancel'])
      canvas.addEventListener(end, (e) => this.pointers.delete(e.pointerId));
    canvas.addEventListener('pointermove', (e) => this.drag(e, canvas));
    canvas.addEventListener('wheel', (e) => {
      e.preventDefault();
      this.zoom(Math.exp(Math.sign(e.deltaY) * 0.1));
    }, { passive: false });
    canvas.addEventListener('dblclick', () => this.reset());
    canvas.addEventListener('contextmenu', (e) => e.preventDefault());
    canvas.addEventListener('keydown', (e) => this.key(e));
  }

  reset() {
    this.azimuth = 0;
    this.elevation = 0;
    this.distance = this.home;
    this.shift = [0, 0];
    this.onChange();
  }

  rotation() { return multiply3(turnAboutX(this.elevation), turnAboutY(this.azimuth)); }

  turn(right, down) {
    this.azimuth += right;
    this.elevation = Math.min(1.5, Math.max(-1.5, this.elevation + down));
    this.onChange();
  }

  zoom(factor) {
    this.distance = Math.min(5 * this.home, Math.max(0.25 * this.home, this.distance * factor));
    this.onChange();
  }

  drag(event, canvas) {
    const before = this.pointers.get(event.pointerId);
    if (!before) return;
    const now = [event.clientX, event.clientY];
    const dx = now[0] - before[0], dy = now[1] - before[1];
    const mmPerPx = 2 * this.distance * Math.tan(0.5 * VIEW_ANGLE) / Math.min(canvas.clientWidth, canvas.clientHeight);
    if (this.pointers.size === 2) {
      const other = [...this.pointers.entries()].find(([id]) => id !== event.pointerId)[1];
      const span = (p) => Math.hypot(p[0] - other[0], p[1] - other[1]) || 1;
      this.shift = [this.shift[0] + 0.5 * dx * mmPerPx, this.shift[1] - 0.5 * dy * mmPerPx];
      this.zoom(span(before) / span(now));
    } else if (event.buttons & 2 || event.shiftKey) {
      this.shift = [this.shift[0] + dx * mmPerPx, this.shift[1] - dy * mmPerPx];
      this.onChange();
    } else {
      this.turn(0.01 * dx, 0.01 * dy);
    }
    this.pointers.set(event.pointerId, now);
  }

  key(event) {
    const step = 0.087; // 5 degrees
    const actions = {
      ArrowLeft: () => this.turn(-step, 0), ArrowRight: () => this.turn(step, 0),
      ArrowUp: () => this.turn(0, -step), ArrowDown: () => this.turn(0, step),
      '+': () => this.zoom(0.9), '=': () => this.zoom(0.9), '-': () => this.zoom(1 / 0.9),
      '0': () => this.reset(), Home: () => this.reset(),
    };
    if (actions[event.key] && !event.ctrlKey && !event.metaKey && !event.altKey) {
      event.preventDefault();
      actions[event.key]();
    }
  }
}

function element(name, properties = {}, ...children) {
  const node = document.createElement(name);
  for (const [key, value] of Object.entries(properties)) {
    if (key in node) node[key] = value; else node.setAttribute(key, value);
  }
  node.append(...children);
  return node;
}

// A button that stays pressed; onToggle(pressed).
function toggle(text, pressed, onToggle) {
  const button = element('button', { type: 'button', textContent: text, 'aria-pressed': String(pressed) });
  button.addEventListener('click', () => {
    const now = button.getAttribute('aria-pressed') !== 'true';
    button.setAttribute('aria-pressed', String(now));
    onToggle(now);
  });
  return button;
}

function push(text, onClick) {
  const button = element('button', { type: 'button', textContent: text });
  button.addEventListener('click', onClick);
  return button;
}

// One slider a morph target; returns { node, show } where show() repeats the face's values.
function expressionSliders(face, onChange) {
  const rows = face.targets.map((target, k) => {
    const low = Math.min(0, target.fitted), high = Math.max(1, target.fitted);
    const input = element('input', { type: 'range', min: low, max: high, step: 0.01, 'aria-label': target.name });
    const output = element('output');
    input.addEventListener('input', () => {
      face.values[k] = Number(input.value);
      output.textContent = face.values[k].toFixed(2);
      onChange();
    });
    return { input, output, node: element('label', { className: 'slider' },
                                          element('span', { textContent: target.name, title: target.name }), input, output) };
  });
  const show = () => rows.forEach((row, k) => {
    row.input.value = face.values[k];
    row.output.textContent = face.values[k].toFixed(2);
  });
  show();
  return { node: element('div', { className: 'sliders' }, ...rows.map((row) => row.node)), show };
}

// Play, pause and scrub through recorded frames; onFrame(index).
function playbackBar(playback, onFrame) {
  const times = decodeBase64(playback.times, Float32Array);
  const slider = element('input', { type: 'range', min: 0, max: times.length - 1, step: 1, value: 0,
                                    'aria-label': 'frame' });
  const label = element('output');
  let startedAt = null;
  const show = (index) => {
    slider.value = index;
    label.textContent = `${times[index].toFixed(2)} s · ${playback.statuses[index]}`;
    onFrame(index);
  };
  const play = toggle('▶ Play', false, (on) => {
    play.textContent = on ? '❚❚ Pause' : '▶ Play';
    startedAt = null;
    if (on) requestAnimationFrame(step);
  });
  function step(now) {
    if (play.getAttribute('aria-pressed') !== 'true') return;
    let index = Number(slider.value);
    if (startedAt === null) {
      if (index >= times.length - 1) index = 0;
      startedAt = now - 1000 * times[index];
    }
    const time = (now - startedAt) / 1000;
    while (index + 1 < times.length && times[index + 1] <= time) ++index;
    if (index >= times.length - 1) startedAt = null; // from the start again
    show(index);
    requestAnimationFrame(step);
  }
  slider.addEventListener('input', () => { startedAt = null; show(Number(slider.value)); });
  return { node: element('div', { className: 'playback' }, play, slider, label), show };
}

function createViewer(container, data) {
  const canvas = element('canvas', { tabIndex: 0, role: 'img', 'aria-label':
    '3D view of the face. Arrow keys turn it, plus and minus zoom, 0 resets.' });
  const gl = canvas.getContext('webgl', { antialias: true, premultipliedAlpha: true });
  if (!gl) {
    container.dataset.viewer = 'no-webgl';
    container.replaceChildren(element('p', { className: 'notice', textContent:
      'This browser offers no WebGL, so the 3D view is not shown. The numbers and pictures of this page do not need it; ' +
      'the same face is in the .glb file beside this page.' }));
    return;
  }
  const face = new MorphedFace(data);
  const look = { surface: data.texture ? 'texture' : 'clay', lit: false, wireframe: false };
  let headRotation = IDENTITY, waiting = false, renderer = null;
  const redraw = () => {
    if (waiting || !renderer) return;
    waiting = true;
    requestAnimationFrame(() => {
      waiting = false;
      const scale = window.devicePixelRatio || 1;
      const width = Math.round(canvas.clientWidth * scale), height = Math.round(canvas.clientHeight * scale);
      if (width === 0 || height === 0) return;
      if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
      renderer.draw(multiply3(orbit.rotation(), headRotation), orbit.distance, orbit.shift, look);
      if (gl.getError() === gl.NO_ERROR) container.dataset.viewer = 'ready';
    });
  };
  const remorph = () => { renderer.update(); redraw(); };
  const orbit = new OrbitControl(canvas, face.radius, redraw);
  renderer = new FaceRenderer(gl, face, data.texture, redraw);

  const surfaces = element('div', { className: 'segments', role: 'group', 'aria-label': 'surface' });
  const choices = data.texture ? ['texture', 'clay'] : ['clay'];
  for (const choice of choices) {
    const button = push(choice[0].toUpperCase() + choice.slice(1), () => {
      look.surface = choice;
      for (const other of surfaces.children) other.setAttribute('aria-pressed', String(other === button));
      redraw();
    });
    button.setAttribute('aria-pressed', String(choice === look.surface));
    surfaces.append(button);
  }
  const tools = element('div', { className: 'tools' }, surfaces);
  if (data.texture) tools.append(toggle('Light', look.lit, (on) => { look.lit = on; redraw(); }));
  tools.append(toggle('Wireframe', look.wireframe, (on) => { look.wireframe = on; redraw(); }));
  tools.append(push('Frontal', () => { headRotation = IDENTITY; orbit.reset(); }));
  if (!data.playback) tools.append(push('As in the picture', () => { headRotation = data.pose; orbit.reset(); }));
  const stage = element('div', { className: 'stage' }, canvas, tools);
  const parts = [stage];
  let sliders = { show: () => {} };
  if (face.targets.length > 0) {
    sliders = expressionSliders(face, remorph);
    const set = (valueOf) => { face.targets.forEach((t, k) => { face.values[k] = valueOf(t); }); sliders.show(); remorph(); };
    parts.push(element('div', { className: 'expressions' },
                       element('div', { className: 'tools' }, element('strong', { textContent: 'Expression' }),
                               push('Neutral', () => set(() => 0)), push('As fitted', () => set((t) => t.fitted))),
                       sliders.node));
  }
  if (data.playback) {
    const rotations = decodeBase64(data.playback.rotations, Float32Array);
    const values = decodeBase64(data.playback.expressions, Float32Array);
    const count = face.targets.length;
    const bar = playbackBar(data.playback, (index) => {
      const rotation = Array.from(rotations.subarray(9 * index, 9 * index + 9));
      const hasFace = rotation.some((x) => x !== 0);
      canvas.classList.toggle('absent', !hasFace);
      if (!hasFace) return;
      headRotation = rotation;
      for (let k = 0; k < count; ++k) face.values[k] = values[count * index + k];
      sliders.show();
      remorph();
    });
    stage.append(bar.node);
    bar.show(0);
  }
  container.replaceChildren(...parts);
  new ResizeObserver(redraw).observe(canvas);
  redraw();
}
