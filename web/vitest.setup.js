// Node 18 has CompressionStream without "deflate-raw", which every browser has: its zlib stands in.
import { Duplex } from "node:stream";
import { createDeflateRaw, createInflateRaw } from "node:zlib";

function standIn(Original, createRaw) {
  return function Stream(format) {
    return format === "deflate-raw" ? Duplex.toWeb(createRaw()) : new Original(format);
  };
}

try {
  new CompressionStream("deflate-raw");
} catch {
  globalThis.CompressionStream = standIn(CompressionStream, createDeflateRaw);
  globalThis.DecompressionStream = standIn(DecompressionStream, createInflateRaw);
}
