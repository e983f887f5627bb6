// Read a recording by @mcap/core and protobufjs and print, as JSON, the SHA-256 of the
// samples of each channel, in the order of their log times, as the metadata say that they are in
// the blocks; what else is in it; and the events.
import { createHash } from "node:crypto";
import { open } from "node:fs/promises";
import { McapIndexedReader } from "@mcap/core";
import { loadDecompressHandlers } from "@mcap/support";
import protobuf from "protobufjs";
import descriptor from "protobufjs/ext/descriptor/index.js";

const file = await open(process.argv[2], "r");
const reader = await McapIndexedReader.Initialize({
  readable: {
    size: async () => (await file.stat({ bigint: true })).size,
    read: async (offset, length) => {
      const buffer = new Uint8Array(Number(length));
      await file.read(buffer, 0, buffer.length, Number(offset));
      return buffer;
    },
  },
  decompressHandlers: await loadDecompressHandlers(),
});
const types = new Map();
for (const [id, schema] of reader.schemasById) {
  const set = descriptor.FileDescriptorSet.decode(schema.data);
  types.set(id, protobuf.Root.fromDescriptor(set).lookupType(schema.name));
}
const samples = {};
const counts = {};
const events = [];
const sizes = { int16: 2, int32: 4, float64: 8 };
let last = 0n;
for await (const message of reader.readMessages({ validateCrcs: true })) {
  const { topic, schemaId, metadata } = reader.channelsById.get(message.channelId);
  const decoded = types.get(schemaId).decode(message.data);
  counts[topic] = (counts[topic] ?? 0) + 1;
  if (message.logTime < last) throw new Error("a message is earlier than the one before");
  last = message.logTime;
  if (topic === "/daq") {
    const names = JSON.parse(metadata.get("channels"));
    const length = decoded.data.length / names.length;
    if (length % sizes[metadata.get("type")]) throw new Error("a sample is incomplete");
    for (const [i, name] of names.entries()) {
      samples[name] ??= createHash("sha256");
      samples[name].update(decoded.data.subarray(i * length, (i + 1) * length));
    }
  }
  if (topic === "/events") events.push([decoded.name, decoded.message, decoded.level]);
}
await file.close();
const digests = Object.fromEntries(
  Object.entries(samples).map(([name, hash]) => [name, hash.digest("hex")]),
);
process.stdout.write(JSON.stringify({ digests, counts, events }));
