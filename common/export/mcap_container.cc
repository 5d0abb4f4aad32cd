// SPDX-License-Identifier: Apache-2.0
#include "common/export/mcap_container.h"

#include <zlib.h>

#include <map>

#include "common/export/little_endian.h"

namespace rigcal {
namespace {

constexpr char kMagic[] = "\x89MCAP0\r\n";

enum class Op : uint8_t {
  kHeader = 0x01,
  kFooter = 0x02,
  kSchema = 0x03,
  kChannel = 0x04,
  kMessage = 0x05,
  kChunk = 0x06,
  kMessageIndex = 0x07,
  kChunkIndex = 0x08,
  kStatistics = 0x0b,
  kDataEnd = 0x0f,
};

uint32_t ChecksumOf(const std::string& bytes, size_t begin = 0) {
  return static_cast<uint32_t>(
      crc32_z(0, reinterpret_cast<const Bytef*>(bytes.data()) + begin, bytes.size() - begin));
}

// Appends numbers and texts as MCAP has them.
class Fields {
 public:
  template <typename Number>
  Fields& Put(Number value) {
    AppendLittleEndian(value, &bytes_);
    return *this;
  }
  Fields& Text(const std::string& text) {
    Put(static_cast<uint32_t>(text.size()));
    bytes_ += text;
    return *this;
  }
  Fields& Bytes(const std::string& bytes) {
    bytes_ += bytes;
    return *this;
  }
  const std::string& bytes() const { return bytes_; }

 private:
  std::string bytes_;
};

void AppendRecord(Op op, const Fields& fields, std::string* file) {
  AppendLittleEndian(static_cast<uint8_t>(op), file);
  AppendLittleEndian(uint64_t{fields.bytes().size()}, file);
  *file += fields.bytes();
}

// Both are in the chunk and again in the summary. Number 0 means "no schema".
void AppendSchemasAndChannels(const McapContent& content, std::string* out) {
  for (size_t i = 0; i < content.schemas.size(); ++i) {
    const McapSchema& schema = content.schemas[i];
    AppendRecord(Op::kSchema,
                 Fields()
                     .Put(static_cast<uint16_t>(i + 1))
                     .Text(schema.name)
                     .Text("jsonschema")
                     .Text(schema.text),
                 out);
  }
  for (size_t i = 0; i < content.channels.size(); ++i) {
    const McapChannel& channel = content.channels[i];
    AppendRecord(Op::kChannel,
                 Fields()
                     .Put(static_cast<uint16_t>(i))
                     .Put(static_cast<uint16_t>(channel.schema + 1))
                     .Text(channel.topic)
                     .Text("json")
                     .Put(uint32_t{0}),  // no metadata
                 out);
  }
}

// Where each channel's messages are in the chunk.
using MessagePlaces = std::map<uint16_t, std::vector<uint64_t>>;

std::string ChunkRecords(const McapContent& content, MessagePlaces* places) {
  std::string records;
  AppendSchemasAndChannels(content, &records);
  uint32_t sequence = 0;
  for (const McapMessage& message : content.messages) {
    (*places)[message.channel].push_back(records.size());
    AppendRecord(Op::kMessage,
                 Fields()
                     .Put(message.channel)
                     .Put(sequence++)
                     .Put(content.time_ns)
                     .Put(content.time_ns)
                     .Bytes(message.json),
                 &records);
  }
  return records;
}

Fields StatisticsOf(const McapContent& content, const MessagePlaces& places) {
  Fields counts;
  for (const auto& [channel, of_channel] : places) {
    counts.Put(channel).Put(uint64_t{of_channel.size()});
  }
  return Fields()
      .Put(uint64_t{content.messages.size()})
      .Put(static_cast<uint16_t>(content.schemas.size()))
      .Put(static_cast<uint32_t>(content.channels.size()))
      .Put(uint32_t{0})  // attachments
      .Put(uint32_t{0})  // metadata
      .Put(uint32_t{1})  // chunks
      .Put(content.time_ns)
      .Put(content.time_ns)
      .Text(counts.bytes());
}

}  // namespace

std::string McapFile(const McapContent& content) {
  std::string file(kMagic, sizeof(kMagic) - 1);
  AppendRecord(Op::kHeader, Fields().Text("").Text("rigcal"), &file);

  MessagePlaces places;
  const std::string records = ChunkRecords(content, &places);
  const uint64_t chunk_begin = file.size();
  AppendRecord(Op::kChunk,
               Fields()
                   .Put(content.time_ns)
                   .Put(content.time_ns)
                   .Put(uint64_t{records.size()})
                   .Put(ChecksumOf(records))
                   .Text("")
                   .Put(uint64_t{records.size()})
                   .Bytes(records),
               &file);
  const uint64_t chunk_end = file.size();

  Fields index_places;
  for (const auto& [channel, of_channel] : places) {
    index_places.Put(channel).Put(uint64_t{file.size()});
    Fields entries;
    for (const uint64_t place : of_channel) entries.Put(content.time_ns).Put(place);
    AppendRecord(Op::kMessageIndex, Fields().Put(channel).Text(entries.bytes()), &file);
  }
  const uint64_t index_end = file.size();
  AppendRecord(Op::kDataEnd, Fields().Put(ChecksumOf(file)), &file);

  const uint64_t summary_begin = file.size();
  AppendSchemasAndChannels(content, &file);
  AppendRecord(Op::kChunkIndex,
               Fields()
                   .Put(content.time_ns)
                   .Put(content.time_ns)
                   .Put(chunk_begin)
                   .Put(chunk_end - chunk_begin)
                   .Text(index_places.bytes())
                   .Put(index_end - chunk_end)
                   .Text("")
                   .Put(uint64_t{records.size()})
                   .Put(uint64_t{records.size()}),
               &file);
  AppendRecord(Op::kStatistics, StatisticsOf(content, places), &file);

  // The footer's checksum covers the summary and the footer up to itself.
  AppendLittleEndian(static_cast<uint8_t>(Op::kFooter), &file);
  AppendLittleEndian(uint64_t{20}, &file);
  AppendLittleEndian(summary_begin, &file);
  AppendLittleEndian(uint64_t{0}, &file);  // no summary offsets
  AppendLittleEndian(ChecksumOf(file, summary_begin), &file);
  file.append(kMagic, sizeof(kMagic) - 1);
  return file;
}

}  // namespace rigcal
