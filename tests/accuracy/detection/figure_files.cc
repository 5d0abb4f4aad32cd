// SPDX-License-Identifier: Apache-2.0
#include "tests/accuracy/detection/figure_files.h"

#include <fmt/core.h>

#include <fstream>

namespace rigcal::accuracy {

void AddFigureOptions(OptionList* options, std::string* csv_path, std::string* png_path) {
  options->Add("--csv", csv_path, "file to write the table to");
  options->Add("--png", png_path, "file to draw the figure to");
}

int WriteFigure(const std::string& csv, const std::string& csv_path, const std::string& png_path,
                const std::function<absl::Status(const std::string& path)>& draw) {
  if (!csv_path.empty()) {
    std::ofstream file(csv_path);
    file << csv;
    file.close();
    if (!file) {
      fmt::print(stderr, "{}: cannot write the table; does its folder exist?\n", csv_path);
      return 1;
    }
  }
  if (png_path.empty()) return 0;
  const absl::Status drawn = draw(png_path);
  if (!drawn.ok()) fmt::print(stderr, "{}\n", std::string(drawn.message()));
  return drawn.ok() ? 0 : 1;
}

}  // namespace rigcal::accuracy
