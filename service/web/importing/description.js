// The dataset.yaml of imported recordings: the user's description of the wing, followed by the recordings.

import { ApiError } from "../base/api.js";

const OURS = ["format_version", "name", "recordings", "held_out"];
const OPTIONAL = ["airspeed_m_s", "angle_of_attack_deg", "gravity_m_s2"];
const MM = 1000; // in a metre

// ``text`` may be a whole dataset.yaml: its own name and recordings are replaced. Its lines keep their numbers, so that
// the errors of the server name those of the user.
export function describe(text, name, recordings) {
  const lines = text.replaceAll("\r\n", "\n").replace(/^\uFEFF/, "").trimEnd().split("\n");
  if (!lines.some((line) => /^wing\s*:/.test(line))) {
    throw new ApiError("The description of the wing has no line that begins with “wing:”; open the description, or download the template and fill it in.");
  }
  return [...withoutKeys(lines, OURS), "format_version: 1", `name: ${JSON.stringify(name)}`, "recordings:", ...recordings.map(entry),
    `held_out: ${JSON.stringify(recordings.filter((one) => one.held_out).map((one) => one.name))}`, ""].join("\n");
}

// ``lines`` of YAML in which those of the top-level ``keys`` are empty.
function withoutKeys(lines, keys) {
  let skipping = false;
  return lines.map((line) => {
    const key = line.match(/^["']?([A-Za-z_]\w*)["']?\s*:/)?.[1];
    if (key) skipping = keys.includes(key);
    else if (/^---/.test(line)) return "";
    return skipping ? "" : line;
  });
}

function entry(one) {
  const fields = ["rig", "flap_frequency_hz", "phase_lag_deg", "pressure_mbar", "temperature_c", ...OPTIONAL].filter((name) => one[name]);
  const window = one.window_from ? [`window_s: [${one.window_from}, ${one.window_to}]`] : [];
  const noise = one.standard_deviation_mm ? [`standard_deviation_m: ${Number(one.standard_deviation_mm) / MM}`] : [];
  return `  - {${[`name: ${JSON.stringify(one.name)}`, ...fields.map((name) => `${name}: ${one[name]}`), ...window, ...noise].join(", ")}}`;
}
