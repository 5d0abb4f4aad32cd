// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <span>
#include <string>
#include <vector>

#include "absl/strings/str_join.h"
#include "common/text/shortest_text.h"

namespace rigcal {

// The shortest text that reads back as the same double, with a decimal point in every case:
// "1.0", "1.0e-07". Readers of YAML 1.1 take "1e-07" for a text, readers of TOML "1" for a whole
// number.
inline std::string DecimalText(double value) {
  std::string text = ShortestText(value);
  if (text.find('.') == std::string::npos) {
    const size_t exponent = text.find('e');
    text.insert(exponent == std::string::npos ? text.size() : exponent, ".0");
  }
  return text;
}

// "[1.0, 2.5]"
inline std::string DecimalList(std::span<const double> values) {
  return "[" +
         absl::StrJoin(values, ", ",
                       [](std::string* out, double value) { *out += DecimalText(value); }) +
         "]";
}
inline std::string DecimalList(const Eigen::Vector3d& vector) {
  return DecimalList(std::span<const double>(vector.data(), 3));
}

// The rows of a matrix, each as a list.
template <int kRows, int kCols>
std::vector<std::string> DecimalRows(const Eigen::Matrix<double, kRows, kCols>& matrix) {
  std::vector<std::string> rows;
  for (int i = 0; i < kRows; ++i) {
    const Eigen::Matrix<double, kCols, 1> row = matrix.row(i);
    rows.push_back(DecimalList(std::span<const double>(row.data(), kCols)));
  }
  return rows;
}

// "[[1.0, 0.0], [0.0, 1.0]]"
template <int kRows, int kCols>
std::string DecimalMatrix(const Eigen::Matrix<double, kRows, kCols>& matrix) {
  return "[" + absl::StrJoin(DecimalRows(matrix), ", ") + "]";
}

}  // namespace rigcal
