// SPDX-License-Identifier: Apache-2.0
#include "agent/command/corner_file.h"

#include <algorithm>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_replace.h"

namespace rigcal::agent {

std::string CornersText(const Board& board, const BoardViews& views) {
  std::string text = "# filename x y\n";
  for (const BoardView& view : views.views) {
    // A space would end the name.
    const std::string name = absl::StrReplaceAll(view.name, {{" ", "_"}});
    for (const Eigen::Vector3d& point : board.Points()) {
      const auto seen = std::ranges::find(view.corners, point, &BoardCorner::x_in_board_m);
      if (seen == view.corners.end()) {
        absl::StrAppend(&text, name, " - -\n");
      } else {
        absl::StrAppendFormat(&text, "%s %.4f %.4f\n", name, seen->pixel.x(), seen->pixel.y());
      }
    }
  }
  return text;
}

}  // namespace rigcal::agent
