// A sketch of the directions of the forces on a vehicle at its body pitch: body axes x and z, lift and drag.

const SPACE = "http://www.w3.org/2000/svg";
const [WIDTH, HEIGHT, ARM, LONG] = [260, 190, 52, 76];

function shape(name, attributes, text) {
  const node = document.createElementNS(SPACE, name);
  for (const [key, value] of Object.entries(attributes)) node.setAttribute(key, value);
  if (text) node.textContent = text;
  return node;
}

// Draw into ``box``: seen from the right, flight to the right, the nose ``pitch`` degrees up.
export function drawDirections(box, pitch) {
  const angle = (pitch * Math.PI) / 180;
  const [x0, y0] = [WIDTH / 2 - 10, HEIGHT / 2];
  const along = ([across, up], length) => [x0 + across * length, y0 - up * length];
  const nose = [Math.cos(angle), Math.sin(angle)];
  const belly = [Math.sin(angle), -Math.cos(angle)];
  const arrow = (direction, label, kind, arm) => {
    const [x, y] = along(direction, arm);
    const [tx, ty] = along(direction, arm + 12);
    const heads = [0.5, -0.5].map((side) => [x - 8 * (direction[0] + side * direction[1]), y + 8 * (direction[1] - side * direction[0])]);
    return [
      shape("line", { x1: x0, y1: y0, x2: x, y2: y, class: kind, "stroke-width": 1.8 }),
      ...heads.map(([hx, hy]) => shape("line", { x1: x, y1: y, x2: hx, y2: hy, class: kind, "stroke-width": 1.8 })),
      shape("text", { x: tx, y: ty + 4, class: kind, "text-anchor": tx < x0 - 8 ? "end" : tx > x0 + 8 ? "start" : "middle" }, label),
    ];
  };
  const svg = shape("svg", { viewBox: `0 0 ${WIDTH} ${HEIGHT}`, role: "img", "aria-label": `Body pitched ${pitch} degrees, nose up: x to the nose, z to the belly, lift upwards, drag backwards` });
  svg.append(
    shape("ellipse", { cx: x0, cy: y0, rx: 34, ry: 7, class: "body", transform: `rotate(${-pitch} ${x0} ${y0})` }),
    ...arrow(nose, "x (nose)", "own", ARM), ...arrow(belly, "z (belly)", "own", ARM), ...arrow([0, 1], "lift", "world", LONG), ...arrow([-1, 0], "drag", "world", LONG),
  );
  box.replaceChildren(svg);
}
