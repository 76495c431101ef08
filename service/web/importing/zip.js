// Writes zip archives, deflated by the browser.

const CRC = Uint32Array.from({ length: 256 }, (_, n) => {
  let value = n;
  for (let bit = 0; bit < 8; bit += 1) value = value & 1 ? 0xedb88320 ^ (value >>> 1) : value >>> 1;
  return value;
});
const FIXED_DATE = 0x21; // 1 January 1980, so that the same files give the same bytes
const VERSION = 20; // deflate
const DEFLATED = 8;
const UTF8_NAMES = 0x800;

function checksum(bytes) {
  let value = 0xffffffff;
  for (const byte of bytes) value = CRC[(value ^ byte) & 0xff] ^ (value >>> 8);
  return (value ^ 0xffffffff) >>> 0;
}

async function deflated(bytes) {
  const stream = new Blob([bytes]).stream().pipeThrough(new CompressionStream("deflate-raw"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

// Little-endian numbers as bytes: [value, count of bytes].
function packed(...fields) {
  const bytes = new Uint8Array(fields.reduce((sum, [, count]) => sum + count, 0));
  let at = 0;
  for (const [value, count] of fields) {
    for (let k = 0; k < count; k += 1) bytes[at + k] = (value / 2 ** (8 * k)) & 0xff;
    at += count;
  }
  return bytes;
}

// An archive of ``files``: {name: text}.
export async function zip(files) {
  const parts = [];
  const directory = [];
  let offset = 0;
  for (const [name, text] of Object.entries(files)) {
    const bytes = new TextEncoder().encode(text);
    const body = await deflated(bytes);
    const path = new TextEncoder().encode(name);
    const common = [[VERSION, 2], [UTF8_NAMES, 2], [DEFLATED, 2], [0, 2], [FIXED_DATE, 2], [checksum(bytes), 4], [body.length, 4], [bytes.length, 4], [path.length, 2], [0, 2]];
    const head = packed([0x04034b50, 4], ...common);
    directory.push(packed([0x02014b50, 4], [VERSION, 2], ...common, [0, 2], [0, 2], [0, 2], [0, 4], [offset, 4]), path);
    parts.push(head, path, body);
    offset += head.length + path.length + body.length;
  }
  const length = directory.reduce((sum, one) => sum + one.length, 0);
  const count = Object.keys(files).length;
  const end = packed([0x06054b50, 4], [0, 2], [0, 2], [count, 2], [count, 2], [length, 4], [offset, 4], [0, 2]);
  return new Blob([...parts, ...directory, end], { type: "application/zip" });
}
