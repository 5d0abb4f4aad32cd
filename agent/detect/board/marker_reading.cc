// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/board/marker_reading.h"

#include <algorithm>
#include <cmath>
#include <opencv2/aruco.hpp>

#include "agent/detect/board/local_plane.h"
#include "common/board/marker_cells.h"
#include "common/board/marker_dictionary.h"

namespace rigcal::agent {
namespace {

constexpr int kCharucoBorderBits = 1, kTagBorderBits = 2;
constexpr double kLeastReadCorrelation = 0.7;  // of the bits within the border, and of all
constexpr double kReadMargin = 0.1;            // to the next marker
constexpr int kPlacesOfBit = 3;                // along a side, in its inner half

// Less its mean, of norm 1: products of two of them are correlations.
Eigen::VectorXd Normalised(const Eigen::VectorXd& values) {
  const Eigen::VectorXd centred = values.array() - values.mean();
  const double norm = centred.norm();
  return norm > 0 ? Eigen::VectorXd(centred / norm) : centred;
}

// Mean brightness of each bit, by row; empty: not in the image.
Eigen::VectorXd BitsWithin(const cv::Mat& grey, const MarkerCorners& corners, int bits) {
  const auto plane = LocalPlane::Through(
      {{{0, 0}, corners[0]}, {{1, 0}, corners[1]}, {{1, 1}, corners[2]}, {{0, 1}, corners[3]}});
  if (!plane) return {};
  Eigen::VectorXd values = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(bits) * bits);
  for (int row = 0; row < bits; ++row) {
    for (int column = 0; column < bits; ++column) {
      for (int k = 0; k < kPlacesOfBit * kPlacesOfBit; ++k) {
        const double u = 0.25 + 0.5 * (k % kPlacesOfBit) / (kPlacesOfBit - 1);
        const double v = 0.25 + 0.5 * (k / kPlacesOfBit) / (kPlacesOfBit - 1);
        const Eigen::Vector2d at = plane->At({(column + u) / bits, (row + v) / bits});
        if (!(at.x() >= 0 && at.y() >= 0 && at.x() < grey.cols - 1 && at.y() < grey.rows - 1)) {
          return {};
        }
        const int x = static_cast<int>(at.x()), y = static_cast<int>(at.y());
        const double a = at.x() - x, b = at.y() - y;
        values[row * bits + column] +=
            ((1 - b) * ((1 - a) * grey.at<uint8_t>(y, x) + a * grey.at<uint8_t>(y, x + 1)) +
             b * ((1 - a) * grey.at<uint8_t>(y + 1, x) + a * grey.at<uint8_t>(y + 1, x + 1))) /
            (kPlacesOfBit * kPlacesOfBit);
      }
    }
  }
  return values;
}

}  // namespace

MarkerReader::MarkerReader(const Board& board) : is_tag_(board.kind == BoardKind::kAprilGrid) {
  const auto dictionary = MarkerDictionary(DictionaryOf(board));
  border_ = is_tag_ ? kTagBorderBits : kCharucoBorderBits;
  const int size = dictionary->markerSize;
  bits_ = size + 2 * border_;
  const int count = (board.IsTwoSided() ? 2 : 1) * board.side_marker_count();
  for (int id = 0; id < std::min(count, dictionary->bytesList.rows); ++id) {
    const cv::Mat bits =
        cv::aruco::Dictionary::getBitsFromByteList(dictionary->bytesList.row(id), size);
    for (size_t turns = 0; turns < 4; ++turns) {
      Eigen::VectorXd whites = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(bits_) * bits_);
      for (int row = 0; row < size; ++row) {
        for (int column = 0; column < size; ++column) {
          // Where the image shows this bit when the marker's upper left is at that corner.
          int r = row + border_, c = column + border_;
          for (size_t turn = 0; turn < turns; ++turn) {
            const int turned_r = c;
            c = bits_ - 1 - r;
            r = turned_r;
          }
          whites[r * bits_ + c] = bits.at<uint8_t>(row, column);
        }
      }
      codes_.push_back({id, turns, Normalised(whites), Normalised(Inner(whites))});
    }
  }
}

Eigen::VectorXd MarkerReader::Inner(const Eigen::VectorXd& all) const {
  const int size = bits_ - 2 * border_;
  Eigen::VectorXd inner(static_cast<Eigen::Index>(size) * size);
  for (int row = 0; row < size; ++row) {
    inner.segment(row * size, size) = all.segment((row + border_) * bits_ + border_, size);
  }
  return inner;
}

std::optional<FoundMarker> MarkerReader::Read(const cv::Mat& grey,
                                              const MarkerCorners& corners) const {
  const Eigen::Vector2d middle = MiddleOf(corners);
  std::optional<FoundMarker> best;
  double best_correlation = 0;
  for (const double shift_px : kTagShiftsPx) {
    MarkerCorners shifted = corners;
    for (Eigen::Vector2d& corner : shifted) corner += shift_px * (corner - middle).normalized();
    const Eigen::VectorXd seen = BitsWithin(grey, shifted, bits_);
    if (seen.size() == 0) continue;
    const Eigen::VectorXd seen_inner = Normalised(Inner(seen));
    double first = 0, second = 0;
    const Code* code = nullptr;
    for (const Code& one : codes_) {
      const double correlation = seen_inner.dot(one.inner);
      if (correlation > first) {
        second = first;
        first = correlation;
        code = &one;
      } else {
        second = std::max(second, correlation);
      }
    }
    if (code != nullptr && first > std::max(best_correlation, kLeastReadCorrelation) &&
        first > second + kReadMargin && Normalised(seen).dot(code->all) > kLeastReadCorrelation) {
      best_correlation = first;
      best = FoundMarker{code->id, {}};
      for (size_t k = 0; k < 4; ++k) {
        // kalibr's tags are upside down for OpenCV.
        best->pixels[k] = corners[(k + code->turns + (is_tag_ ? 2 : 0)) % 4];
      }
    }
    if (!is_tag_) break;
  }
  return best;
}

}  // namespace rigcal::agent
