// The picture of a camera on a canvas: enlarged and moved by pointer, wheel or keys, with marks over it.

import { el } from "../base/format.js";

const CLOSER = 1.25;
const CLOSEST = 40;
const CLICK_PX = 4; // a pointer that moves less clicks
const ROOM = 1.5; // around a part that is shown, of its size
const STEP = 0.15; // of the width, by an arrow key
const PICTURE_STEP = 320; // pixels; pictures are fetched in widths that are multiples of it

// Colours over a picture, which is dark in both themes of the page.
export const LOOK = { seen: "#ffb454", found: "#4fd8e0", label: "#ffffff", cursor: "#ff5fa2", shade: "rgba(0,0,0,.65)" };

// A view of a camera {name, width_px, height_px}. ``paint(pen, at, size)`` draws marks; ``at(x, y)`` is the place of a
// pixel on the screen, ``size`` the screen pixels of an image pixel. ``onPick(pixel, size)`` gets a click; ``onKey`` may
// handle a key first, and returns whether it did. ``onCloser`` is called when a picture with more pixels is needed.
export function cameraView({ name, width_px: width, height_px: height }, { paint, onPick = null, onKey = () => false, onCloser = () => {} }) {
  const canvas = el("canvas", { tabIndex: 0, role: "img", ariaLabel: `Camera ${name}` });
  canvas.style.aspectRatio = `${width} / ${height}`;
  let picture = null;
  let [zoom, gain] = [1, 1];
  let centre = [width / 2, height / 2];
  const size = () => (zoom * canvas.clientWidth) / width;
  const corner = () => [0, 1].map((k) => centre[k] - [canvas.clientWidth, canvas.clientHeight][k] / size() / 2);
  // Pixel (0, 0) is the centre of the upper left pixel.
  const at = (x, y) => [(x + 0.5 - corner()[0]) * size(), (y + 0.5 - corner()[1]) * size()];
  const pixel = (event) => {
    const box = canvas.getBoundingClientRect();
    const [left, top] = corner();
    return [(event.clientX - box.left - canvas.clientLeft) / size() + left - 0.5, (event.clientY - box.top - canvas.clientTop) / size() + top - 0.5];
  };

  function draw() {
    const [across, down] = [canvas.clientWidth, canvas.clientHeight];
    if (!across || !down) return;
    const ratio = window.devicePixelRatio || 1;
    [canvas.width, canvas.height] = [Math.round(across * ratio), Math.round(down * ratio)];
    const pen = canvas.getContext("2d");
    pen.scale(ratio, ratio);
    pen.font = `600 12px ${getComputedStyle(document.body).fontFamily}`;
    if (picture) {
      const [x, y] = at(-0.5, -0.5);
      pen.imageSmoothingEnabled = size() < 3;
      pen.filter = gain === 1 ? "none" : `brightness(${gain})`;
      pen.drawImage(picture, x, y, width * size(), height * size());
      pen.filter = "none";
    }
    paint(pen, at, size());
  }

  function keepInside() {
    const half = [canvas.clientWidth / size() / 2, canvas.clientHeight / size() / 2];
    centre = [width, height].map((full, k) => (2 * half[k] >= full ? full / 2 : Math.min(Math.max(centre[k], half[k]), full - half[k])));
    canvas.style.touchAction = zoom > 1 ? "none" : "pan-y"; // the whole picture leaves scrolling to the page
  }

  // Change the zoom by ``factor``, with the image pixel ``fixed`` staying where it is.
  function closer(factor, fixed = centre) {
    const next = Math.min(Math.max(zoom * factor, 1), CLOSEST);
    centre = centre.map((value, k) => fixed[k] + ((value - fixed[k]) * zoom) / next);
    zoom = next;
    keepInside();
    draw();
    onCloser();
  }

  function move(dx, dy) {
    centre = [centre[0] + dx, centre[1] + dy];
    keepInside();
    draw();
  }

  function key(event) {
    const step = STEP * (canvas.clientWidth / size());
    const moves = { ArrowLeft: [-step, 0], ArrowRight: [step, 0], ArrowUp: [0, -step], ArrowDown: [0, step] }[event.key];
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    if (!onKey(event)) {
      if (event.key === "+" || event.key === "=") closer(CLOSER);
      else if (event.key === "-") closer(1 / CLOSER);
      else if (event.key === "0") closer(1 / CLOSEST);
      else if (moves && zoom > 1) move(...moves);
      else return;
    }
    event.preventDefault();
  }

  let from = null;
  canvas.addEventListener("keydown", key);
  canvas.addEventListener("wheel", (event) => {
    if (event.deltaY > 0 && zoom === 1) return; // the page scrolls on
    event.preventDefault();
    closer(event.deltaY < 0 ? CLOSER : 1 / CLOSER, pixel(event));
  }, { passive: false });
  canvas.addEventListener("pointerdown", (event) => {
    if (event.button !== 0) return;
    from = { start: [event.clientX, event.clientY], last: [event.clientX, event.clientY], moved: false };
    canvas.setPointerCapture(event.pointerId);
  });
  canvas.addEventListener("pointermove", (event) => {
    if (!from) return;
    from.moved ||= Math.hypot(event.clientX - from.start[0], event.clientY - from.start[1]) >= CLICK_PX;
    if (from.moved) move((from.last[0] - event.clientX) / size(), (from.last[1] - event.clientY) / size());
    from.last = [event.clientX, event.clientY];
  });
  canvas.addEventListener("pointerup", (event) => {
    const clicked = from && !from.moved;
    from = null;
    if (clicked && onPick) onPick(pixel(event), size());
  });
  canvas.addEventListener("pointercancel", () => { from = null; });
  const resized = new ResizeObserver(() => {
    keepInside();
    draw();
  });
  resized.observe(canvas);

  const button = (text, label, action) => el("button", { type: "button", ariaLabel: `${label}, camera ${name}`, title: label, onclick: action }, text);
  const buttons = el("span", { className: "view-buttons" }, button("−", "Smaller", () => closer(1 / CLOSER)),
    button("+", "Larger", () => closer(CLOSER)), button("All", "See all", () => closer(1 / CLOSEST)));
  return {
    canvas, buttons, draw,
    show(next) {
      picture?.close?.();
      picture = next;
      draw();
    },
    setGain(next) {
      gain = next;
      draw();
    },
    // Move the view such that an image pixel is seen.
    reveal([x, y]) {
      const [px, py] = at(x, y);
      if (px < 0 || py < 0 || px > canvas.clientWidth || py > canvas.clientHeight) centre = [x, y];
      keepInside();
      draw();
    },
    // Enlarge the part that holds ``pixels``, with some room around it.
    fit(pixels) {
      const [low, high] = [Math.min, Math.max].map((most) => [0, 1].map((k) => most(...pixels.map((one) => one[k]))));
      const room = [width, height].map((full, k) => full / (ROOM * Math.max(high[k] - low[k], full / CLOSEST)));
      centre = [0, 1].map((k) => (low[k] + high[k]) / 2);
      zoom = Math.min(Math.max(1, Math.min(...room)), CLOSEST);
      keepInside();
      draw();
    },
    // The width in which a picture is fetched for the present size.
    pictureWidth: () => Math.min(width, PICTURE_STEP * Math.max(1, Math.ceil((zoom * canvas.clientWidth * (window.devicePixelRatio || 1)) / PICTURE_STEP))),
    close: () => resized.disconnect(),
  };
}

export function circle(pen, [x, y], radius, colour, thick = 1.5) {
  pen.strokeStyle = colour;
  pen.lineWidth = thick;
  pen.beginPath();
  pen.arc(x, y, radius, 0, 2 * Math.PI);
  pen.stroke();
}

export function cross(pen, [x, y], reach, colour) {
  pen.strokeStyle = colour;
  pen.lineWidth = 1.5;
  pen.beginPath();
  pen.moveTo(x - reach, y);
  pen.lineTo(x + reach, y);
  pen.moveTo(x, y - reach);
  pen.lineTo(x, y + reach);
  pen.stroke();
}

// A name beside a mark, legible on any picture.
export function name(pen, [x, y], text, colour) {
  const width = pen.measureText(text).width;
  const left = x + 12 + width > pen.canvas.clientWidth ? x - 12 - width : x + 12;
  pen.fillStyle = LOOK.shade;
  pen.fillRect(left - 2, y - 8, width + 4, 16);
  pen.fillStyle = colour;
  pen.textBaseline = "middle";
  pen.fillText(text, left, y);
}

// Run ``action`` with the last of the given arguments, never twice at once: pictures are not queued while a slider moves.
export function latest(action) {
  let [busy, waiting] = [false, null];
  const run = async (...given) => {
    if (busy) {
      waiting = given;
      return;
    }
    busy = true;
    try {
      await action(...given);
    } finally {
      busy = false;
      if (waiting) {
        const next = waiting;
        waiting = null;
        run(...next);
      }
    }
  };
  return run;
}

// How much brighter the position of a range of stops makes a picture; its text is set.
export function gainOf(range) {
  const gain = 2 ** Number(range.value);
  range.setAttribute("aria-valuetext", `${Number(gain.toPrecision(2))} times`);
  return gain;
}
