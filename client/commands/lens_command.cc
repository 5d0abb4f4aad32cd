// SPDX-License-Identifier: Apache-2.0
#include "client/commands/lens_command.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "client/commands/command_parser.h"
#include "common/import/intrinsics_file.h"
#include "common/lens/lens_difference.h"
#include "common/status/status_macros.h"

namespace rigcal::client {
namespace {

// Of the map that is printed.
constexpr int kShownColumns = 6, kShownRows = 4;

absl::StatusOr<LensDifference> Compare(const LensDiffOptions& options, ImageSize* size) {
  RIGCAL_ASSIGN_OR_RETURN(const IntrinsicsFile a, ReadIntrinsicsFile(options.a, options.camera));
  RIGCAL_ASSIGN_OR_RETURN(const IntrinsicsFile b, ReadIntrinsicsFile(options.b, options.camera));
  if (!(a.image_size_px == b.image_size_px)) {
    return absl::InvalidArgumentError(absl::StrCat(
        options.a, " is of an image of ", a.image_size_px.width, " x ", a.image_size_px.height,
        " pixels, ", options.b, " of ", b.image_size_px.width, " x ", b.image_size_px.height,
        ": two lenses are compared in images of one size, region and binning"));
  }
  *size = a.image_size_px;
  return CompareLenses(a.intrinsics, b.intrinsics, a.image_size_px);
}

// The largest difference of each part of the image, from the upper left.
std::string MapText(const LensDifference& difference) {
  std::string text;
  for (int row = 0; row < kShownRows; ++row) {
    text += "   ";
    for (int column = 0; column < kShownColumns; ++column) {
      double most = -1;
      for (int y = row * LensDifference::kRows / kShownRows;
           y < (row + 1) * LensDifference::kRows / kShownRows; ++y) {
        for (int x = column * LensDifference::kColumns / kShownColumns;
             x < (column + 1) * LensDifference::kColumns / kShownColumns; ++x) {
          const double here =
              difference.map_px[static_cast<size_t>(y * LensDifference::kColumns + x)];
          if (std::isfinite(here)) most = std::max(most, here);
        }
      }
      text += most < 0 ? "       -" : absl::StrFormat("%8.3f", most);
    }
    text += "\n";
  }
  return text;
}

nlohmann::ordered_json MapJson(const LensDifference& difference) {
  auto rows = nlohmann::ordered_json::array();
  for (int y = 0; y < LensDifference::kRows; ++y) {
    auto row = nlohmann::ordered_json::array();
    for (int x = 0; x < LensDifference::kColumns; ++x) {
      const double here = difference.map_px[static_cast<size_t>(y * LensDifference::kColumns + x)];
      row.push_back(std::isfinite(here) ? nlohmann::ordered_json(here) : nullptr);
    }
    rows.push_back(std::move(row));
  }
  return rows;
}

}  // namespace

ExitCode CompareLensFiles(const LensDiffOptions& options, CommandContext& context) {
  ImageSize size;
  const absl::StatusOr<LensDifference> difference = Compare(options, &size);
  if (!difference.ok()) return context.Fail(difference.status());
  if (context.console.format == OutputFormat::kJson) {
    const nlohmann::ordered_json json = {{"image_px", {size.width, size.height}},
                                         {"median_px", difference->median_px},
                                         {"p95_px", difference->p95_px},
                                         {"most_px", difference->most_px},
                                         {"unknown_share", difference->unknown_share},
                                         {"turned_deg", difference->turned_deg},
                                         {"map_px", MapJson(*difference)}};
    context.console.out << JsonText(json) << "\n" << std::flush;
    return ExitCode::kOk;
  }
  std::string text = absl::StrFormat(
      "%.3f px apart (median), %.3f px in 95 %% of the image, %.3f px at most\n"
      "after a turn of %.4f degrees was taken out, which a calibration of the rig finds anyway\n"
      "largest difference in each part of the image, px:\n%s",
      difference->median_px, difference->p95_px, difference->most_px, difference->turned_deg,
      MapText(*difference));
  if (difference->unknown_share > 0) {
    absl::StrAppendFormat(&text, "one of the two has no ray in %.1f %% of the image\n",
                          100 * difference->unknown_share);
  }
  context.console.Print(text);
  return ExitCode::kOk;
}

void AddLensCommands(CommandParser& parser) {
  CLI::App* const group = parser.AddGroup("lens", "Files of lenses");
  auto [app, options] = parser.AddCommand(
      group, "diff", "Say how far two lenses of one camera are apart, in pixels", CompareLensFiles,
      /*asks_server=*/false);
  AddArgument(app, "A", "A file with a lens: OpenCV, ROS, kalibr, mrcal, ...", &options->a);
  AddArgument(app, "B", "Another one of the same camera", &options->b);
  AddOption(app, "--camera", "CAMERA", &options->camera, "Which one, of files with several");
}

}  // namespace rigcal::client
