// Unpacks the arrays of a compressed .glb with meshoptimizer's own decoder, and compares them with those of the same
// .glb uncompressed: node meshopt.mjs NODE_MODULES PLAIN.glb COMPRESSED.glb
import fs from 'node:fs';
import path from 'node:path';
import { pathToFileURL } from 'node:url';

const [modules, plainName, packedName] = process.argv.slice(2);
const decoder = path.resolve(modules, 'meshoptimizer/meshopt_decoder.mjs');
const { MeshoptDecoder } = await import(pathToFileURL(decoder));
await MeshoptDecoder.ready;

function load(name) {
  const bytes = fs.readFileSync(name), length = bytes.readUInt32LE(12);
  return { json: JSON.parse(bytes.subarray(20, 20 + length)), body: bytes.subarray(28 + length), size: bytes.length };
}
// Triangles may begin with another corner; the smallest comes first here.
function turned(bytes, stride) {
  const copy = Uint8Array.from(bytes).buffer, corners = stride === 2 ? new Uint16Array(copy) : new Uint32Array(copy);
  for (let i = 0; i < corners.length; i += 3) {
    const three = [...corners.subarray(i, i + 3)], first = three.indexOf(Math.min(...three));
    corners.set([three[first], three[(first + 1) % 3], three[(first + 2) % 3]], i);
  }
  return new Uint8Array(copy);
}
const plain = load(plainName), packed = load(packedName);
if (plain.json.bufferViews.length !== packed.json.bufferViews.length) throw new Error('another number of views');
plain.json.bufferViews.forEach((view, number) => {
  const { byteOffset, byteLength, byteStride, count, mode } = packed.json.bufferViews[number].extensions.EXT_meshopt_compression;
  const found = new Uint8Array(count * byteStride), start = view.byteOffset ?? 0;
  MeshoptDecoder.decodeGltfBuffer(found, count, byteStride, packed.body.subarray(byteOffset, byteOffset + byteLength), mode);
  const own = plain.body.subarray(start, start + view.byteLength), order = bytes => mode === 'TRIANGLES' ? turned(bytes, byteStride) : bytes;
  if (Buffer.compare(Buffer.from(order(found)), Buffer.from(order(own)))) throw new Error(`view ${number} differs`);
});
console.log(`${plain.json.bufferViews.length} arrays are the same, ${plain.size} bytes as it is, ${packed.size} compressed`);
