// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace rigcal {

// Arrays of a MATLAB file of level 5 (MathWorks, "MAT-File Format"), each as the bytes of a data
// element. `name` is that of a variable; empty within a struct.

// A row of numbers, or [] where there are none.
std::string MatRow(std::string_view name, std::span<const double> values);
std::string MatMatrix(std::string_view name, const Eigen::MatrixXd& values);
std::string MatText(std::string_view name, std::string_view ascii);

// A 1 x N array of structs. Each element has the same fields in the same order; their names are at
// most 31 letters.
using MatFields = std::vector<std::pair<std::string, std::string>>;
std::string MatStructs(std::string_view name, std::span<const MatFields> elements);

// The file of these variables. `description` is its first line, at most 116 letters.
std::string MatFile(std::string_view description, std::span<const std::string> variables);

}  // namespace rigcal
