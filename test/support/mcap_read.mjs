// Reads an MCAP file with the official reader (@mcap/core) and writes what it finds as lines of JSON: one a message, then
// one of the whole file. Arguments: the folder with node_modules, the file, "indexed" or "streamed".
import { createHash } from "node:crypto";
import { open, readFile } from "node:fs/promises";
import { createRequire } from "node:module";

const [folder, path, how] = process.argv.slice(2);
const require = createRequire(folder + "/node_modules/");
const { McapIndexedReader, McapStreamReader } = require("@mcap/core");
const fzstd = require("fzstd");
const protobuf = require("protobufjs");
const descriptor = require("protobufjs/ext/descriptor");
const decompressHandlers = { zstd: (bytes) => fzstd.decompress(new Uint8Array(bytes)) };

const decoders = new Map();
function decoder(schema) {
  if (!decoders.has(schema.id)) {
    const root = protobuf.Root.fromDescriptor(descriptor.FileDescriptorSet.decode(schema.data));
    decoders.set(schema.id, root.lookupType(schema.name));
  }
  return decoders.get(schema.id);
}

let lines = [];
function say(value) {
  lines.push(JSON.stringify(value));
  if (lines.length > 500) flush();
}
function flush() {
  if (lines.length > 0) process.stdout.write(lines.join("\n") + "\n");
  lines = [];
}

function show(message, channel, schema) {
  const line = { topic: channel.topic, schema: schema?.name, log: String(message.logTime), publish: String(message.publishTime) };
  if (channel.messageEncoding === "json") {
    line.text = new TextDecoder().decode(message.data);
    JSON.parse(line.text);
    JSON.parse(new TextDecoder().decode(schema.data));
  } else {
    const type = decoder(schema);
    const value = type.toObject(type.decode(message.data), { longs: String });
    if (value.data) value.data = createHash("sha256").update(value.data).digest("hex");
    line.value = value;
  }
  say(line);
}

if (how === "indexed") {
  const file = await open(path, "r");
  const readable = {
    size: async () => BigInt((await file.stat()).size),
    read: async (offset, length) => {
      const bytes = new Uint8Array(Number(length));
      await file.read(bytes, 0, Number(length), Number(offset));
      return bytes;
    },
  };
  const reader = await McapIndexedReader.Initialize({ readable, decompressHandlers });
  for await (const message of reader.readMessages({ validateCrcs: true })) {
    const channel = reader.channelsById.get(message.channelId);
    show(message, channel, reader.schemasById.get(channel.schemaId));
  }
  const statistics = reader.statistics;
  say({ file: { messages: String(statistics.messageCount), chunks: statistics.chunkCount, channels: statistics.channelCount,
                indexed: reader.chunkIndexes.length } });
} else {
  const reader = new McapStreamReader({ validateCrcs: true, decompressHandlers });
  reader.append(await readFile(path));
  const schemas = new Map();
  const channels = new Map();
  let messages = 0;
  for (let record; (record = reader.nextRecord()); ) {
    if (record.type === "Schema") schemas.set(record.id, record);
    if (record.type === "Channel") channels.set(record.id, record);
    if (record.type !== "Message") continue;
    const channel = channels.get(record.channelId);
    show(record, channel, schemas.get(channel.schemaId));
    ++messages;
  }
  say({ file: { messages: String(messages), done: reader.done() } });
}
flush();
