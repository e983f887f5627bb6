// Read a recording by @mcap/core and protobufjs and print, as JSON, the SHA-256 of the
// samples of each channel, in the order of their log times, and what else is in it.
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
for await (const message of reader.readMessages({ validateCrcs: true })) {
  const { topic, schemaId } = reader.channelsById.get(message.channelId);
  const decoded = types.get(schemaId).decode(message.data);
  counts[topic] = (counts[topic] ?? 0) + 1;
  if (topic.startsWith("/daq/")) {
    samples[topic] ??= createHash("sha256");
    samples[topic].update(new Uint8Array(new Float64Array(decoded.volts).buffer));
  }
}
await file.close();
const digests = Object.fromEntries(
  Object.entries(samples).map(([topic, hash]) => [topic, hash.digest("hex")]),
);
process.stdout.write(JSON.stringify({ digests, counts }));
