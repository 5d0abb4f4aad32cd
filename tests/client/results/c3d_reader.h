// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

namespace rigcal::testing {

struct C3dParameter {
  int element_bytes = 0;  // -1: letters
  std::vector<int> dimensions;
  std::string data;

  std::vector<int> Words() const;
  double Float() const;
  // One text, or one for each of the last dimension, without spaces behind.
  std::vector<std::string> Texts() const;
};

struct C3dPoint {
  std::array<float, 3> position = {};
  int word = 0;  // mask and residual; -1: no point
};

struct C3dContent {
  int points = 0, first_frame = 0, last_frame = 0, data_block = 0;
  double scale = 0, rate_hz = 0;                   // of the header
  std::map<std::string, C3dParameter> parameters;  // "POINT:USED"
  std::vector<std::vector<C3dPoint>> frames;
};

// Reads a floating-point file in Intel byte order by the format's documentation (The C3D File
// Format User Guide, c3d.org). Throws std::out_of_range or std::runtime_error where it is none.
C3dContent ReadC3d(const std::string& bytes);

}  // namespace rigcal::testing
