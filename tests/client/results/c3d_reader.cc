// SPDX-License-Identifier: Apache-2.0
#include "tests/client/results/c3d_reader.h"

#include <cstring>
#include <stdexcept>

namespace rigcal::testing {
namespace {

constexpr size_t kBlock = 512;

int ByteAt(const std::string& bytes, size_t at) { return static_cast<uint8_t>(bytes.at(at)); }

int SignedByteAt(const std::string& bytes, size_t at) {
  return static_cast<int8_t>(ByteAt(bytes, at));
}

int WordAt(const std::string& bytes, size_t at) {
  return ByteAt(bytes, at) | ByteAt(bytes, at + 1) << 8;
}

float FloatAt(const std::string& bytes, size_t at) {
  float value = 0;
  if (at + sizeof(value) > bytes.size()) throw std::out_of_range("the file ends in a number");
  std::memcpy(&value, bytes.data() + at, sizeof(value));
  return value;
}

void Require(bool holds, const char* what) {
  if (!holds) throw std::runtime_error(what);
}

C3dParameter ParameterAt(const std::string& bytes, size_t at) {
  C3dParameter parameter;
  parameter.element_bytes = SignedByteAt(bytes, at);
  const int dimensions = ByteAt(bytes, at + 1);
  Require(dimensions <= 7, "more than seven dimensions");
  at += 2;
  size_t count = static_cast<size_t>(std::abs(parameter.element_bytes));
  for (int i = 0; i < dimensions; ++i, ++at) {
    parameter.dimensions.push_back(ByteAt(bytes, at));
    count *= static_cast<size_t>(parameter.dimensions.back());
  }
  Require(at + count <= bytes.size(), "a parameter is longer than the file");
  parameter.data = bytes.substr(at, count);
  return parameter;
}

// Returns where the section ends.
size_t ReadParameters(const std::string& bytes, C3dContent* content) {
  const size_t begin = (static_cast<size_t>(ByteAt(bytes, 0)) - 1) * kBlock;
  Require(ByteAt(bytes, begin + 3) == 84, "not in Intel byte order");
  std::map<int, std::string> groups;
  size_t at = begin + 4;
  while (true) {
    const auto name_size = static_cast<size_t>(std::abs(SignedByteAt(bytes, at)));
    const int id = SignedByteAt(bytes, at + 1);
    Require(name_size > 0 && id != 0, "a parameter without a name or a group");
    const std::string name = bytes.substr(at + 2, name_size);
    const size_t offset_at = at + 2 + name_size;
    if (id < 0) {
      groups[-id] = name;
    } else {
      content->parameters[groups.at(id) + ":" + name] = ParameterAt(bytes, offset_at + 2);
    }
    const int offset = WordAt(bytes, offset_at);
    if (offset == 0) break;
    at = offset_at + static_cast<size_t>(offset);
  }
  const size_t end = begin + kBlock * static_cast<size_t>(ByteAt(bytes, begin + 2));
  Require(at < end, "the parameters are longer than their section");
  return end;
}

}  // namespace

std::vector<int> C3dParameter::Words() const {
  Require(element_bytes == 2, "no words");
  std::vector<int> words;
  for (size_t at = 0; at < data.size(); at += 2) words.push_back(WordAt(data, at));
  return words;
}

double C3dParameter::Float() const {
  Require(element_bytes == 4 && data.size() == 4, "not one number");
  return static_cast<double>(FloatAt(data, 0));
}

std::vector<std::string> C3dParameter::Texts() const {
  Require(element_bytes == -1 && !dimensions.empty(), "no text");
  std::vector<std::string> texts;
  const auto length = static_cast<size_t>(dimensions[0]);
  for (size_t at = 0; at < data.size(); at += length) {
    std::string text = data.substr(at, length);
    text.resize(text.find_last_not_of(' ') + 1);
    texts.push_back(text);
  }
  return texts;
}

C3dContent ReadC3d(const std::string& bytes) {
  Require(bytes.size() % kBlock == 0, "not in blocks of 512 bytes");
  Require(ByteAt(bytes, 1) == 0x50, "without the key of the format");
  C3dContent content;
  content.points = WordAt(bytes, 2);
  Require(WordAt(bytes, 4) == 0, "with analog data");
  content.first_frame = WordAt(bytes, 6);
  content.last_frame = WordAt(bytes, 8);
  content.scale = static_cast<double>(FloatAt(bytes, 12));
  content.data_block = WordAt(bytes, 16);
  content.rate_hz = static_cast<double>(FloatAt(bytes, 20));
  Require(content.scale < 0, "not of floating-point numbers");
  const size_t end = ReadParameters(bytes, &content);
  // As "Reading the frame count" says.
  size_t frames = static_cast<size_t>(content.parameters.at("POINT:FRAMES").Words().at(0));
  if (frames == 65535 && content.parameters.contains("TRIAL:ACTUAL_END_FIELD")) {
    const auto words = content.parameters.at("TRIAL:ACTUAL_END_FIELD").Words();
    frames = static_cast<size_t>(words.at(0)) + (static_cast<size_t>(words.at(1)) << 16);
  }
  size_t at = (static_cast<size_t>(content.data_block) - 1) * kBlock;
  Require(at >= end, "the data begin within the parameters");
  for (size_t frame = 0; frame < frames; ++frame) {
    std::vector<C3dPoint>& points = content.frames.emplace_back();
    for (int i = 0; i < content.points; ++i, at += 16) {
      C3dPoint& point = points.emplace_back();
      for (size_t axis = 0; axis < 3; ++axis) point.position[axis] = FloatAt(bytes, at + 4 * axis);
      point.word = static_cast<int>(FloatAt(bytes, at + 12));
    }
  }
  return content;
}

}  // namespace rigcal::testing
