// Runs the conformance suite through the module: run.mjs MODULE SUITE
import { readFileSync } from 'node:fs';
import { join } from 'node:path';

const [, , module, suite] = process.argv;
const { instance } = await WebAssembly.instantiate(readFileSync(module), {});
const { memory, place, result, answer, rule } = instance.exports;
const words = (at, count) => Array.from(new Uint32Array(memory.buffer.slice(at, at + 4 * count)));
let vectors = 0;
let right = 0;
for (const line of readFileSync(join(suite, 'manifest.tsv'), 'utf8').split('\n')) {
  if (line === '' || line.startsWith('#')) continue;
  const [kind, file, dictionary, third, ...stated] = line.split('\t');
  const bytes = readFileSync(join(suite, file));
  const other = dictionary === '-' ? null : readFileSync(join(suite, dictionary));
  const limits = kind === 'valid' || third === '-' ? [0, 0, 0] : third.split(',').map(Number);
  new Uint8Array(memory.buffer, place()).set(bytes);
  if (other) new Uint8Array(memory.buffer, place() + bytes.length).set(other);
  const code = answer(bytes.length, other ? other.length : 0xffffffff, ...limits.map((n) => n || 0xffffffff));
  let told = '-';
  if (code === 0) told = Buffer.from(memory.buffer.slice(result(), result() + 32)).toString('hex');
  if (code === 2) {
    const [number, part, offset, found] = words(result(), 4);
    const name = rule(number);
    const at = Number(name >> 32n);
    const id = Buffer.from(memory.buffer.slice(at, at + Number(name & 0xffffffffn))).toString();
    told = [id, part ? 'dictionary' : 'file', offset, found].join('\t');
  }
  vectors += 1;
  if (told === (kind === 'valid' ? third : stated.join('\t'))) right += 1;
  else console.log(`${file}: ${told}`);
}
console.log(`vectors ${vectors}\nright ${right}\n${vectors === right && vectors > 100 ? 'all right' : 'NOT ALL RIGHT'}`);
process.exit(vectors === right ? 0 : 1);
