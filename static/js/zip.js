// A zip of files that are stored as they are, as PKWARE's application note describes it.

const LOCAL = 0x04034b50;
const CENTRAL = 0x02014b50;
const END = 0x06054b50;
const VERSION = 20;
const UTF8 = 0x0800;

const TABLE = Uint32Array.from({ length: 256 }, (_, byte) => {
  let rest = byte;
  for (let bit = 0; bit < 8; bit += 1) rest = rest & 1 ? 0xedb88320 ^ (rest >>> 1) : rest >>> 1;
  return rest;
});

/** A blob of the files' names and contents. */
export async function zipped(files) {
  const parts = [];
  const directory = [];
  let at = 0;
  for (const file of files) {
    const name = new TextEncoder().encode(file.name);
    const content = new Uint8Array(await file.arrayBuffer());
    const about = [VERSION, UTF8, 0, 0, 0, ["u32", crc(content)], ["u32", content.length], ["u32", content.length]];
    const lengths = [name.length, 0];
    const head = numbers(["u32", LOCAL], ...about, ...lengths);
    directory.push(
      numbers(["u32", CENTRAL], VERSION, ...about, ...lengths, 0, 0, 0, ["u32", 0], ["u32", at]),
      name,
    );
    parts.push(head, name, content);
    at += head.length + name.length + content.length;
  }
  const size = directory.reduce((sum, part) => sum + part.length, 0);
  const end = numbers(["u32", END], 0, 0, files.length, files.length, ["u32", size], ["u32", at], 0);
  return new Blob([...parts, ...directory, end], { type: "application/zip" });
}

/** Little-endian bytes of numbers of two bytes, or of four where they say so. */
function numbers(...values) {
  const bytes = values.flatMap((value) => {
    const [count, number] = Array.isArray(value) ? [4, value[1]] : [2, value];
    return Array.from({ length: count }, (_, k) => (number >>> (8 * k)) & 0xff);
  });
  return Uint8Array.from(bytes);
}

function crc(bytes) {
  let rest = 0xffffffff;
  for (const byte of bytes) rest = TABLE[(rest ^ byte) & 0xff] ^ (rest >>> 8);
  return (rest ^ 0xffffffff) >>> 0;
}
