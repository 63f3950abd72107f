"use strict";
// The slider.
const compare = document.querySelector(".compare");
const slider = document.getElementById("slider");
const cut = () => compare.style.setProperty("--cut", slider.value + "%");
slider.addEventListener("input", cut);
cut();

// The mesh. A vertex is 24 bytes: position 3 x float32, normal 4 x int8, uv 2 x uint16, colour 4 x uint8 whose alpha
// is 0 where the texture counts.
const VERTEX = `#version 300 es
layout(location = 0) in vec3 position;
layout(location = 1) in vec4 normal;
layout(location = 2) in vec2 uv;
layout(location = 3) in vec4 colour;
uniform mat4 matrix;
out vec3 n;
out vec2 t;
out vec4 c;
void main() { gl_Position = matrix * vec4(position, 1.0); n = normal.xyz; t = uv; c = colour; }`;
const FRAGMENT = `#version 300 es
precision highp float;
in vec3 n;
in vec2 t;
in vec4 c;
uniform sampler2D skin;
uniform bool clay;
out vec4 pixel;
void main() {
  float light = 0.35 + 0.65 * max(dot(normalize(n), normalize(vec3(0.4, 0.6, 0.7))), 0.0);
  vec3 base = mix(texture(skin, t).rgb, c.rgb, c.a);
  pixel = vec4(clay ? vec3(0.82, 0.80, 0.77) * light : base, 1.0);
}`;

const bytesOf = async (text) => {
  const packed = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
};

// Column-major 4 x 4 matrices.
const multiply = (a, b) => {
  const m = new Float32Array(16);
  for (let c = 0; c < 4; c++) for (let r = 0; r < 4; r++) for (let k = 0; k < 4; k++) m[4 * c + r] += a[4 * k + r] * b[4 * c + k];
  return m;
};
const shift = (x, y, z) => new Float32Array([1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, x, y, z, 1]);
const turnX = (a) => new Float32Array([1, 0, 0, 0, 0, Math.cos(a), Math.sin(a), 0, 0, -Math.sin(a), Math.cos(a), 0, 0, 0, 0, 1]);
const turnY = (a) => new Float32Array([Math.cos(a), 0, -Math.sin(a), 0, 0, 1, 0, 0, Math.sin(a), 0, Math.cos(a), 0, 0, 0, 0, 1]);
const lens = (tangent, aspect, near, far) => new Float32Array([
  1 / tangent, 0, 0, 0, 0, aspect / tangent, 0, 0, 0, 0, (near + far) / (near - far), -1, 0, 0, (2 * near * far) / (near - far), 0,
]);

const compile = (gl) => {
  const program = gl.createProgram();
  for (const [kind, source] of [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, FRAGMENT]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, source);
    gl.compileShader(shader);
    gl.attachShader(program, shader);
  }
  gl.linkProgram(program);
  if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(program));
  gl.useProgram(program);
  return program;
};

const upload = async (gl, scene) => {
  gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
  gl.bufferData(gl.ARRAY_BUFFER, await bytesOf(scene.vertices), gl.STATIC_DRAW);
  gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
  gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, await bytesOf(scene.indices), gl.STATIC_DRAW);
  for (const [place, size, kind, whole, offset] of [
    [0, 3, gl.FLOAT, false, 0], [1, 4, gl.BYTE, true, 12], [2, 2, gl.UNSIGNED_SHORT, true, 16], [3, 4, gl.UNSIGNED_BYTE, true, 20],
  ]) {
    gl.enableVertexAttribArray(place);
    gl.vertexAttribPointer(place, size, kind, whole, 24, offset);
  }
};

const start = async () => {
  const scene = JSON.parse(document.getElementById("scene").textContent);
  const canvas = document.getElementById("view");
  const gl = canvas.getContext("webgl2", { antialias: true, preserveDrawingBuffer: true });
  if (!gl) {
    canvas.hidden = true;
    document.getElementById("lost").hidden = false;
    return;
  }
  const program = compile(gl);
  await upload(gl, scene);
  const where = (name) => gl.getUniformLocation(program, name);
  const [matrix, clay] = [where("matrix"), where("clay")];
  gl.bindTexture(gl.TEXTURE_2D, gl.createTexture());
  for (const side of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T]) gl.texParameteri(gl.TEXTURE_2D, side, gl.CLAMP_TO_EDGE);
  gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.LINEAR_MIPMAP_LINEAR);
  // Neighbouring pixels may lie on different surfaces: between them nothing is blended.
  gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAG_FILTER, gl.NEAREST);
  gl.enable(gl.DEPTH_TEST);
  gl.clearColor(0.115, 0.12, 0.135, 1);

  const home = { yaw: 0, pitch: 0, distance: scene.pivot, x: 0, y: 0 };
  let view = { ...home };
  const [skin, planes] = [document.getElementById("skin"), document.getElementById("planes")];
  let asked = false;
  const draw = () => {
    asked = false;
    canvas.width = Math.round(canvas.clientWidth * devicePixelRatio);
    canvas.height = Math.round(canvas.clientHeight * devicePixelRatio);
    gl.viewport(0, 0, canvas.width, canvas.height);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    // At home this is the photo's camera: at the origin, looking down -Z.
    const place = [shift(view.x, view.y, -view.distance), turnX(view.pitch), turnY(view.yaw), shift(0, 0, scene.pivot)].reduce(multiply);
    gl.uniformMatrix4fv(matrix, false, multiply(lens(scene.tangent, scene.aspect, scene.near, scene.far), place));
    gl.uniform1i(clay, skin.value === "clay" ? 1 : 0);
    gl.drawElements(gl.TRIANGLES, planes.checked ? scene.all : scene.surface, gl.UNSIGNED_INT, 0);
  };
  const redraw = () => { if (!asked) { asked = true; requestAnimationFrame(draw); } };
  const dress = async () => {
    const image = document.getElementById(skin.value === "clay" ? "photo" : skin.value);
    await image.decode();
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, gl.RGBA, gl.UNSIGNED_BYTE, image);
    gl.generateMipmap(gl.TEXTURE_2D);
    redraw();
  };
  const turn = (yaw, pitch) => {
    view.yaw += yaw;
    view.pitch = Math.max(-1.5, Math.min(1.5, view.pitch + pitch));
    redraw();
  };
  canvas.addEventListener("pointerdown", (event) => canvas.setPointerCapture(event.pointerId));
  canvas.addEventListener("pointermove", (event) => {
    if (!canvas.hasPointerCapture(event.pointerId)) return;
    const [dx, dy] = [event.movementX / canvas.clientWidth, event.movementY / canvas.clientWidth];
    if (!event.shiftKey) return turn(3 * dx, 3 * dy);
    view.x += 2 * dx * scene.tangent * view.distance;
    view.y -= 2 * dy * scene.tangent * view.distance;
    redraw();
  });
  canvas.addEventListener("wheel", (event) => {
    event.preventDefault();
    view.distance = Math.min(scene.far / 2, Math.max(scene.near * 2, view.distance * Math.exp(event.deltaY * 0.001)));
    redraw();
  }, { passive: false });
  canvas.addEventListener("keydown", (event) => {
    const step = { ArrowLeft: [-0.1, 0], ArrowRight: [0.1, 0], ArrowUp: [0, -0.1], ArrowDown: [0, 0.1] }[event.key];
    if (step) { event.preventDefault(); turn(...step); }
  });
  document.getElementById("home").addEventListener("click", () => { view = { ...home }; redraw(); });
  skin.addEventListener("change", dress);
  planes.addEventListener("change", redraw);
  addEventListener("resize", redraw);
  await dress();
  draw();
  document.body.dataset.ready = "yes";
};
start();
