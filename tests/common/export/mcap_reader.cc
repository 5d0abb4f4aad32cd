// SPDX-License-Identifier: Apache-2.0
// MCAP (mcap.dev, "MCAP Format Specification") with Foxglove's messages ("Schemas").
#include <zlib.h>

#include <Eigen/Geometry>
#include <cstring>
#include <map>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "tests/common/export/export_readers.h"

namespace rigcal::testing {
namespace {

const std::string kMcapMagic("\x89MCAP0\r\n", 8);

class McapBytes {
 public:
  explicit McapBytes(const std::string& bytes, size_t at = 0) : bytes_(bytes), at_(at) {}
  template <typename Number>
  Number Get() {
    Number value;
    std::memcpy(&value, Slice(sizeof value).data(), sizeof value);
    return value;
  }
  std::string Text() { return Slice(Get<uint32_t>()); }
  std::string Slice(uint64_t size) {
    if (size > bytes_.size() - at_) throw std::runtime_error("MCAP: too short");
    at_ += size;
    return bytes_.substr(at_ - size, size);
  }
  std::string Rest() { return Slice(bytes_.size() - at_); }
  bool AtEnd() const { return at_ == bytes_.size(); }
  size_t at() const { return at_; }

 private:
  const std::string bytes_;
  size_t at_;
};

uint32_t Crc(const std::string& bytes) {
  return static_cast<uint32_t>(
      crc32(0, reinterpret_cast<const Bytef*>(bytes.data()), static_cast<uInt>(bytes.size())));
}

void Expect(bool condition, const char* what) {
  if (!condition) throw std::runtime_error(std::string("MCAP: ") + what);
}

struct McapRead {
  std::map<uint16_t, std::string> schemas, channels;
  std::map<uint16_t, uint16_t> schema_of_channel;
  std::vector<std::pair<std::string, nlohmann::json>> messages;  // schema, content
  std::vector<std::string> topics;
};

void ReadRecord(uint8_t op, const std::string& content, McapRead* file) {
  McapBytes record(content);
  if (op == 0x03) {
    const auto id = record.Get<uint16_t>();
    Expect(id != 0, "schema 0");
    file->schemas[id] = record.Text();
    Expect(record.Text() == "jsonschema", "schema encoding");
    Expect(nlohmann::json::parse(record.Text()).at("title") == file->schemas[id], "schema title");
  } else if (op == 0x04) {
    const auto id = record.Get<uint16_t>();
    file->schema_of_channel[id] = record.Get<uint16_t>();
    file->channels[id] = record.Text();
    Expect(file->schemas.contains(file->schema_of_channel[id]), "channel before its schema");
    Expect(record.Text() == "json", "message encoding");
    Expect(record.Text().empty(), "metadata");
  } else if (op == 0x05) {
    const auto channel = record.Get<uint16_t>();
    record.Slice(4 + 8 + 8);
    Expect(file->channels.contains(channel), "message before its channel");
    file->messages.emplace_back(file->schemas.at(file->schema_of_channel.at(channel)),
                                nlohmann::json::parse(record.Rest()));
    file->topics.push_back(file->channels.at(channel));
  }
}

// The first byte of the chunk's record, and whether index and statistics say the same.
void CheckSummary(const std::string& bytes, size_t begin, size_t end, size_t chunk_at,
                  const McapRead& file) {
  McapBytes summary(bytes.substr(0, end), begin);
  bool index = false, statistics = false;
  while (!summary.AtEnd()) {
    const auto op = summary.Get<uint8_t>();
    McapBytes record(summary.Slice(summary.Get<uint64_t>()));
    if (op == 0x08) {
      record.Slice(16);
      Expect(record.Get<uint64_t>() == chunk_at, "place of the chunk");
      McapBytes chunk(bytes, chunk_at);
      Expect(chunk.Get<uint8_t>() == 0x06, "no chunk at its place");
      Expect(record.Get<uint64_t>() == chunk.Get<uint64_t>() + 9, "length of the chunk");
      McapBytes places(record.Text());
      while (!places.AtEnd()) {
        const auto channel = places.Get<uint16_t>();
        McapBytes at(bytes, places.Get<uint64_t>());
        Expect(at.Get<uint8_t>() == 0x07, "no message index at its place");
        at.Get<uint64_t>();
        Expect(at.Get<uint16_t>() == channel, "message index of another channel");
      }
      index = true;
    }
    if (op == 0x0b) {
      Expect(record.Get<uint64_t>() == file.messages.size(), "count of messages");
      Expect(record.Get<uint16_t>() == file.schemas.size(), "count of schemas");
      Expect(record.Get<uint32_t>() == file.channels.size(), "count of channels");
      statistics = true;
    }
  }
  Expect(index && statistics, "index or statistics are missing");
}

McapRead ReadMcapBytes(const std::string& bytes) {
  McapBytes file(bytes);
  Expect(file.Slice(8) == kMcapMagic && bytes.ends_with(kMcapMagic), "magic");
  Expect(file.Get<uint8_t>() == 0x01, "no header");
  file.Slice(file.Get<uint64_t>());
  McapRead read;
  size_t chunk_at = 0;
  for (;;) {
    const size_t at = file.at();
    const auto op = file.Get<uint8_t>();
    McapBytes record(file.Slice(file.Get<uint64_t>()));
    if (op == 0x06) {
      chunk_at = at;
      record.Slice(16);
      const auto size = record.Get<uint64_t>();
      const auto crc = record.Get<uint32_t>();
      Expect(record.Text().empty(), "compression");
      const std::string records = record.Slice(record.Get<uint64_t>());
      Expect(records.size() == size && Crc(records) == crc, "chunk's checksum");
      McapBytes inner(records);
      while (!inner.AtEnd()) {
        const auto inner_op = inner.Get<uint8_t>();
        ReadRecord(inner_op, inner.Slice(inner.Get<uint64_t>()), &read);
      }
    }
    if (op == 0x0f) {
      Expect(record.Get<uint32_t>() == Crc(bytes.substr(0, at)), "checksum of the data");
      break;
    }
  }
  const size_t footer_at = bytes.size() - 8 - 20 - 9;
  McapBytes footer(bytes, footer_at);
  Expect(footer.Get<uint8_t>() == 0x02 && footer.Get<uint64_t>() == 20, "no footer");
  const auto summary_at = footer.Get<uint64_t>();
  footer.Get<uint64_t>();
  const size_t crc_at = footer.at();
  Expect(footer.Get<uint32_t>() == Crc(bytes.substr(summary_at, crc_at - summary_at)),
         "checksum of the summary");
  CheckSummary(bytes, summary_at, footer_at, chunk_at, read);
  return read;
}

}  // namespace

ReadCameras ReadMcapFile(const ExportedFiles& files) {
  const McapRead file = ReadMcapBytes(ContentOf(files, "rig.mcap"));
  std::map<std::string, Eigen::Matrix4d> rig_from;
  for (const auto& [schema, message] : file.messages) {
    if (schema != "foxglove.FrameTransforms") continue;
    for (const auto& transform : message.at("transforms")) {
      Expect(transform.at("parent_frame_id") == "rig", "parent frame");
      const auto& q = transform.at("rotation");
      const auto& t = transform.at("translation");
      Eigen::Matrix4d pose = Eigen::Matrix4d::Identity();
      pose.topLeftCorner<3, 3>() =
          Eigen::Quaterniond(q.at("w").get<double>(), q.at("x").get<double>(),
                             q.at("y").get<double>(), q.at("z").get<double>())
              .toRotationMatrix();
      pose.topRightCorner<3, 1>() << t.at("x").get<double>(), t.at("y").get<double>(),
          t.at("z").get<double>();
      rig_from[transform.at("child_frame_id")] = pose;
    }
  }
  ReadCameras cameras;
  for (size_t i = 0; i < file.messages.size(); ++i) {
    const auto& [schema, message] = file.messages[i];
    if (schema != "foxglove.CameraCalibration") continue;
    OpenCvCamera camera;
    const auto k = message.at("K").get<std::vector<double>>();
    camera.k = CameraMatrix(k.at(0), k.at(4), k.at(2), k.at(5));
    camera.distortion = message.at("D").get<std::vector<double>>();
    camera.fisheye = message.at("distortion_model") == "kannala_brandt";
    camera.cam_from_rig = rig_from.at(message.at("frame_id")).inverse();
    const std::string& topic = file.topics[i];  // /NAME/calibration
    cameras.push_back({.name = topic.substr(1, topic.find('/', 1) - 1),
                       .width_px = message.at("width"),
                       .height_px = message.at("height"),
                       .project = [camera](const auto& x) { return camera.Project(x); }});
  }
  return cameras;
}

}  // namespace rigcal::testing
