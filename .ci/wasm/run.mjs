// Prints the digest that the module computes: `node run.mjs MODULE.wasm`. It imports nothing.
import { readFileSync } from "node:fs";

const { instance } = await WebAssembly.instantiate(readFileSync(process.argv[2]), {});
console.log(BigInt.asUintN(64, instance.exports.digest()).toString());
