// SPDX-License-Identifier: Apache-2.0
// MATLAB's files of level 5 (MathWorks, "MAT-File Format"): doubles, texts and struct arrays.
#include <cstring>
#include <map>
#include <stdexcept>

#include "tests/common/export/export_readers.h"

namespace rigcal::testing {
namespace {

struct MatElement {
  uint32_t type = 0;
  std::string data;
};

// The next element; long tags, and short ones that hold their data.
MatElement NextElement(const std::string& bytes, size_t* at) {
  uint32_t words[2];
  if (*at + 8 > bytes.size()) throw std::runtime_error("MAT: too short");
  std::memcpy(words, bytes.data() + *at, 8);
  MatElement element;
  if (words[0] >> 16 != 0) {
    element = {words[0] & 0xffff, bytes.substr(*at + 4, words[0] >> 16)};
    *at += 8;
    return element;
  }
  element = {words[0], bytes.substr(*at + 8, words[1])};
  if (element.data.size() != words[1]) throw std::runtime_error("MAT: too short");
  *at += 8 + (words[1] + 7) / 8 * 8;
  return element;
}

template <typename Number>
std::vector<Number> NumbersIn(const MatElement& element, uint32_t type) {
  if (element.type != type) throw std::runtime_error("MAT: wrong type");
  std::vector<Number> numbers(element.data.size() / sizeof(Number));
  if (!numbers.empty()) std::memcpy(numbers.data(), element.data.data(), element.data.size());
  return numbers;
}

struct MatArray {
  std::string name;
  Eigen::MatrixXd values;                            // of numbers
  std::string text;                                  // of letters
  std::vector<std::map<std::string, MatArray>> all;  // of structs
};

MatArray ParseArray(const std::string& data) {
  size_t at = 0;
  const auto flags = NumbersIn<uint32_t>(NextElement(data, &at), 6);
  const auto size = NumbersIn<int32_t>(NextElement(data, &at), 5);
  MatArray array;
  array.name = NextElement(data, &at).data;
  switch (flags.at(0) & 0xff) {
    case 6: {
      const auto numbers = NumbersIn<double>(NextElement(data, &at), 9);
      if (static_cast<int>(numbers.size()) != size.at(0) * size.at(1)) {
        throw std::runtime_error("MAT: wrong size");
      }
      array.values = Eigen::MatrixXd(size[0], size[1]);
      for (size_t i = 0; i < numbers.size(); ++i) {  // columns one after the other
        array.values(static_cast<int>(i) % size[0], static_cast<int>(i) / size[0]) = numbers[i];
      }
      break;
    }
    case 4:
      for (const uint16_t letter : NumbersIn<uint16_t>(NextElement(data, &at), 4)) {
        array.text += static_cast<char>(letter);
      }
      break;
    case 2: {
      const auto length = static_cast<size_t>(NumbersIn<int32_t>(NextElement(data, &at), 5).at(0));
      const std::string names = NextElement(data, &at).data;
      for (int i = 0; i < size.at(0) * size.at(1); ++i) {
        auto& fields = array.all.emplace_back();
        for (size_t field = 0; field < names.size() / length; ++field) {
          const MatElement element = NextElement(data, &at);
          if (element.type != 14) throw std::runtime_error("MAT: a field is no array");
          fields[names.substr(field * length, length).c_str()] = ParseArray(element.data);
        }
      }
      break;
    }
    default:
      throw std::runtime_error("MAT: unexpected class");
  }
  if (at != data.size()) throw std::runtime_error("MAT: an array has more");
  return array;
}

}  // namespace

ReadCameras ReadMatFile(const ExportedFiles& files) {
  const std::string& bytes = ContentOf(files, "rig.mat");
  if (bytes.size() < 128 || bytes.substr(124, 4) != std::string("\x00\x01IM", 4)) {
    throw std::runtime_error("MAT: header");
  }
  ReadCameras cameras;
  for (size_t at = 128; at < bytes.size();) {
    const MatElement element = NextElement(bytes, &at);
    if (element.type != 14) throw std::runtime_error("MAT: a variable is no array");
    const MatArray array = ParseArray(element.data);
    if (array.name != "cameras") continue;
    for (const auto& fields : array.all) {
      OpenCvCamera camera;
      camera.k = fields.at("K").values;
      const Eigen::MatrixXd& k = fields.at("DistortionCoefficients").values;
      camera.distortion.assign(k.data(), k.data() + k.size());
      camera.fisheye = fields.at("DistortionModel").text == "equidistant";
      if (fields.at("DistortionModel").text == "plumb_bob") {
        // cameraIntrinsics' own names: k1 k2 k3, p1 p2.
        const Eigen::MatrixXd& radial = fields.at("RadialDistortion").values;
        const Eigen::MatrixXd& tangential = fields.at("TangentialDistortion").values;
        camera.distortion = {radial(0, 0), radial(0, 1), tangential(0, 0), tangential(0, 1),
                             radial(0, 2)};
      }
      camera.cam_from_rig.topLeftCorner<3, 3>() = fields.at("R").values;
      camera.cam_from_rig.topRightCorner<3, 1>() = fields.at("t").values;
      cameras.push_back({.name = fields.at("name").text,
                         .width_px = fields.at("ImageSize").values(0, 1),
                         .height_px = fields.at("ImageSize").values(0, 0),
                         .time_offset_s = fields.at("TimeOffset").values(0, 0),
                         // The centre of the first pixel is (1, 1) in MATLAB.
                         .project = [camera](const auto& x) {
                           return Eigen::Vector2d(camera.Project(x) - Eigen::Vector2d(1, 1));
                         }});
    }
  }
  return cameras;
}

}  // namespace rigcal::testing
