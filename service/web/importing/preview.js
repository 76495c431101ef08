// The imported markers in 3-D over time, on a canvas: rotate by pointer or arrow keys, play, or choose a time.

import { $, fixed, rounded } from "../base/format.js";

const TURN = Math.PI / 24; // of a key
const STEEPEST = Math.PI / 2;
const ZOOM = 1.15;
const LOOP_MS = 6000; // for all frames, at least
const LEAST_MS = 33;
const TRAIL = 24; // frames before the present one
const FILLED = 0.47; // of the canvas, by the sphere around all positions
const NAMED = 24; // more markers have names only on request
const VIEWS = { free: [-0.9, 0.35], side: [0, 0], front: [Math.PI / 2, 0], top: [0, Math.PI / 2] };
const DIRECTIONS = { wing: ["x aft", "y out", "z up"], body: ["x nose", "y right", "z down"], file: ["x", "y", "z"] };
const EDGES = [[0, 1], [0, 2], [0, 4], [1, 3], [1, 5], [2, 3], [2, 6], [3, 7], [4, 5], [4, 6], [5, 7], [6, 7]];

let shown = null; // names, times, positions [n][M][3], frame, centre, radius, low, high
let [yaw, pitch] = VIEWS.free;
let zoom = 1;
let timer = null;

export function setUpPreview() {
  const canvas = $("import-canvas");
  $("import-time").addEventListener("input", draw);
  $("import-labels").addEventListener("change", draw);
  $("import-play").addEventListener("click", () => (timer ? stopPreview() : play()));
  $("import-view").addEventListener("change", () => {
    [yaw, pitch] = VIEWS[$("import-view").value];
    draw();
  });
  canvas.addEventListener("keydown", onKey);
  let from = null;
  canvas.addEventListener("pointerdown", (event) => {
    from = [event.clientX, event.clientY];
    canvas.setPointerCapture(event.pointerId);
  });
  canvas.addEventListener("pointermove", (event) => {
    if (!from) return;
    turn((event.clientX - from[0]) / 150, event.pointerType === "touch" ? 0 : (event.clientY - from[1]) / 150);
    from = [event.clientX, event.clientY];
  });
  for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, () => { from = null; });
  new ResizeObserver(draw).observe(canvas);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", draw);
}

function onKey(event) {
  const turns = { ArrowLeft: [-TURN, 0], ArrowRight: [TURN, 0], ArrowUp: [0, -TURN], ArrowDown: [0, TURN] }[event.key];
  if (turns) turn(...turns);
  else if (event.key === "+" || event.key === "=") zoom *= ZOOM;
  else if (event.key === "-") zoom /= ZOOM;
  else return;
  event.preventDefault();
  draw();
}

function turn(byYaw, byPitch) {
  yaw += byYaw;
  pitch = Math.max(-STEEPEST, Math.min(STEEPEST, pitch + byPitch));
  $("import-view").value = "free";
  draw();
}

export function showPreview({ markers, preview, frame, statements, frames }) {
  const up = statements.find((one) => one.fact === "up")?.value;
  const low = [0, 1, 2].map((k) => 1e3 * Math.min(...markers.map((one) => one.low_m[k])));
  const high = [0, 1, 2].map((k) => 1e3 * Math.max(...markers.map((one) => one.high_m[k])));
  const centre = low.map((value, k) => (value + high[k]) / 2);
  const sameFile = shown?.names.length === markers.length && shown.times.length === preview.time_s.length;
  shown = {
    names: markers.map((one) => one.name), times: preview.time_s, positions: preview.positions_mm, frame, low, high, centre,
    radius: Math.hypot(...low.map((value, k) => (high[k] - value) / 2)) || 1, vertical: verticalOf(frame, up),
  };
  if (!sameFile) {
    $("import-time").value = 0;
    $("import-labels").checked = markers.length <= NAMED;
    zoom = 1;
  }
  $("import-time").max = preview.time_s.length - 1;
  const some = preview.stride > 1 ? ` One in ${preview.stride} of the ${frames.toLocaleString("en")} frames is shown.` : "";
  $("import-preview-note").textContent = `Drag, or use the arrow keys, to rotate; + and − zoom. The box is ${high.map((value, k) => rounded(value - low[k], 3)).join(" × ")} mm along ${DIRECTIONS[frame].map((one) => one[0]).join(", ")}.${some}`;
  draw();
}

// The axis that is up on the screen, and its sign.
function verticalOf(frame, up) {
  if (frame === "body") return [2, -1];
  const match = frame === "file" && up?.match(/^([+-])([XYZ])/);
  return match ? ["XYZ".indexOf(match[2]), match[1] === "-" ? -1 : 1] : [2, 1];
}

const fill = (width, height) => FILLED * Math.min(width, height); // boxes of any shape, turned anyhow, fit

// A function from a position (mm) to [x, y] on the screen and a depth, larger ones are closer.
function projection(width, height) {
  const scale = (zoom * fill(width, height)) / shown.radius;
  const [axis, sign] = shown.vertical;
  const [a, b] = [(axis + 1) % 3, (axis + 2) % 3];
  const [cy, sy, cp, sp] = [Math.cos(yaw), Math.sin(yaw), Math.cos(pitch), Math.sin(pitch)];
  return (position) => {
    const [p, q, r] = [position[a] - shown.centre[a], sign * (position[b] - shown.centre[b]), sign * (position[axis] - shown.centre[axis])];
    const [across, away] = [cy * p - sy * q, sy * p + cy * q];
    return [width / 2 + scale * across, height / 2 - scale * (cp * r + sp * away), sp * r - cp * away];
  };
}

export function draw() {
  const canvas = $("import-canvas");
  const [width, height] = [canvas.clientWidth, canvas.clientHeight];
  if (!shown || !width) return;
  const ratio = window.devicePixelRatio || 1;
  canvas.width = Math.round(width * ratio);
  canvas.height = Math.round(height * ratio);
  const pen = canvas.getContext("2d");
  pen.scale(ratio, ratio);
  const look = colours();
  pen.font = `12px ${look.font}`;
  const project = projection(width, height);
  const at = Number($("import-time").value);
  drawBox(pen, project, look);
  drawTrails(pen, project, look, at);
  drawMarkers(pen, project, look, at, width);
  drawAxes(pen, look, width, height);
  const text = `${fixed(shown.times[at], 3)} s`;
  $("import-time-value").textContent = text;
  $("import-time").setAttribute("aria-valuetext", text);
}

function colours() {
  const style = getComputedStyle(document.documentElement);
  const colour = (name) => style.getPropertyValue(`--${name}`).trim();
  return { ink: colour("ink"), quiet: colour("quiet"), line: colour("line"), accent: colour("accent"), axes: ["series-2", "series-3", "series-1"].map(colour),
    font: getComputedStyle(document.body).fontFamily };
}

function drawBox(pen, project, look) {
  const corners = Array.from({ length: 8 }, (_, n) => project([0, 1, 2].map((k) => (n & (4 >> k) ? shown.high[k] : shown.low[k]))));
  pen.strokeStyle = look.line;
  pen.lineWidth = 1;
  pen.beginPath();
  for (const [from, to] of EDGES) {
    pen.moveTo(corners[from][0], corners[from][1]);
    pen.lineTo(corners[to][0], corners[to][1]);
  }
  pen.stroke();
}

const isThere = (position) => position[0] !== null;

function drawTrails(pen, project, look, at) {
  pen.strokeStyle = look.accent;
  pen.globalAlpha = 0.35;
  pen.lineWidth = 1.5;
  pen.beginPath();
  for (let m = 0; m < shown.names.length; m += 1) {
    let open = false;
    for (let t = Math.max(0, at - TRAIL); t <= at; t += 1) {
      const position = shown.positions[t][m];
      if (!isThere(position)) {
        open = false;
        continue;
      }
      const [x, y] = project(position);
      if (open) pen.lineTo(x, y);
      else pen.moveTo(x, y);
      open = true;
    }
  }
  pen.stroke();
  pen.globalAlpha = 1;
}

function drawMarkers(pen, project, look, at, width) {
  const dots = shown.positions[at].map((position, m) => (isThere(position) ? { name: shown.names[m], point: project(position) } : null)).filter(Boolean);
  dots.sort((one, other) => one.point[2] - other.point[2]);
  const size = dots.length > 60 ? 3 : 4.5;
  for (const { point: [x, y] } of dots) {
    pen.fillStyle = look.accent;
    pen.beginPath();
    pen.arc(x, y, size, 0, 2 * Math.PI);
    pen.fill();
  }
  if (!$("import-labels").checked) return;
  pen.fillStyle = look.ink;
  for (const { name, point: [x, y] } of dots) {
    const right = x + 8 + pen.measureText(name).width < width;
    pen.textAlign = right ? "left" : "right";
    pen.fillText(name, right ? x + 8 : x - 8, y + 4);
  }
}

// The directions of the axes, in the lower left corner.
function drawAxes(pen, look, width, height) {
  const [length, x0, y0] = [34, 58, height - 58];
  const turned = projection(width, height);
  const origin = turned(shown.centre);
  pen.lineWidth = 2;
  pen.textAlign = "center";
  const full = zoom * fill(width, height);
  DIRECTIONS[shown.frame].forEach((name, k) => {
    const end = turned(shown.centre.map((value, axis) => value + (axis === k ? shown.radius : 0)));
    const [dx, dy] = [0, 1].map((i) => ((end[i] - origin[i]) / full) * length);
    pen.strokeStyle = look.axes[k];
    pen.fillStyle = look.axes[k];
    pen.beginPath();
    pen.moveTo(x0, y0);
    pen.lineTo(x0 + dx, y0 + dy);
    pen.stroke();
    if (Math.hypot(dx, dy) > 0.15 * length) pen.fillText(name, x0 + 1.45 * dx, y0 + 1.35 * dy + 4); // else it points at the viewer
  });
}

function play() {
  if (!shown) return;
  const count = shown.times.length;
  const stride = Math.max(1, Math.ceil((LEAST_MS * count) / LOOP_MS));
  timer = setInterval(() => {
    $("import-time").value = (Number($("import-time").value) + stride) % count;
    draw();
  }, Math.max(LEAST_MS, (LOOP_MS * stride) / count));
  $("import-play").textContent = "Pause";
  $("import-play").setAttribute("aria-pressed", "true");
}

export function stopPreview() {
  clearInterval(timer);
  timer = null;
  if (!$("import-play")) return;
  $("import-play").textContent = "Play";
  $("import-play").setAttribute("aria-pressed", "false");
}
