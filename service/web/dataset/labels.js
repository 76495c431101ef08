// Which names of points in 3-D are written, and on which side of their points, so that none covers another name or a point.

const CHARACTER = 7.4; // px, width of one of the font of the names
const LINE = 12; // px, height of a name
const AWAY = 13; // px, from a point to the middle of a name above or below it
const BESIDE = 6; // px, from a point to a name at its side
const POINT = 3; // px, half the size of a point, less what a name may cover
const UNITS = 2.25; // of the scene in the height of a chart whose projection is orthographic
const SIDES = [["top center", 0, -1], ["bottom center", 0, 1], ["middle right", 1, 0], ["middle left", -1, 0],
  ["top right", 1, -1], ["top left", -1, -1], ["bottom right", 1, 1], ["bottom left", -1, 1]];

const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const dot = (a, b) => a.reduce((sum, value, k) => sum + value * b[k], 0);
const unit = (a) => a.map((value) => value / Math.hypot(...a));
const vector = ({ x, y, z }) => [x, y, z];

// Places of ``points`` on the screen in px, seen by ``camera``; ``ranges`` and ``ratio`` of the axes, ``height`` of the chart.
export function projected(points, camera, { ranges, ratio, height }) {
  const forward = unit(vector(camera.eye).map((value) => -value));
  const right = unit(cross(forward, vector(camera.up ?? { x: 0, y: 0, z: 1 })));
  const up = cross(right, forward);
  const scale = height / UNITS;
  return points.map((point) => {
    const at = point.map((value, k) => ((value - ranges[k][0]) / (ranges[k][1] - ranges[k][0]) - 0.5) * ratio[k]);
    return [scale * dot(at, right), -scale * dot(at, up)];
  });
}

// The names that have room at their places [x, y] in px: index, side, and box [left, top, right, bottom].
export function placed(names, places) {
  const taken = places.map(([x, y]) => [x - POINT, y - POINT, x + POINT, y + POINT]);
  return names.flatMap((name, index) => {
    const wide = CHARACTER * name.length;
    for (const [side, across, down] of SIDES) {
      const [x, y] = [places[index][0] + across * (BESIDE + wide / 2), places[index][1] + down * AWAY];
      const box = [x - wide / 2, y - LINE / 2, x + wide / 2, y + LINE / 2];
      if (taken.some((one) => box[0] < one[2] && one[0] < box[2] && box[1] < one[3] && one[1] < box[3])) continue;
      taken.push(box);
      return [{ name, index, side, box }];
    }
    return [];
  });
}
