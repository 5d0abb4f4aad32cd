// SPDX-License-Identifier: Apache-2.0
#include "agent/identify/stick_sight.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include "agent/identify/ring_background.h"

namespace rigcal::agent {
namespace {

constexpr double kOffSphere = 1.15, kOffSpherePx = 1.5;  // radii
constexpr size_t kPieces = 8, kFewestPieces = 3;
constexpr double kLeastPiecePx = 1.5;
constexpr int kAlong = 4;                                  // samples of a piece
constexpr double kSideRadii = 0.35, kSidePx = 2;           // from the line
constexpr float kLeastStickGrey = 5, kAlikeColour = 0.6f;  // cosine of the angle of colours
constexpr float kLeastOfStick = 0.25f, kSameGrey = 0.12f;  // of the mean difference

}  // namespace

double StickShare(const ImageView& image, const Eigen::Vector2d& from_px,
                  const Eigen::Vector2d& to_px, double radius_px) {
  const Eigen::Vector2d way = to_px - from_px;
  const double length_px = way.norm();
  const auto pieces =
      std::min(kPieces, static_cast<size_t>(std::max(0.0, length_px / kLeastPiecePx)));
  if (pieces < kFewestPieces) return 0;
  const Eigen::Vector2d across = Eigen::Vector2d(-way.y(), way.x()) / length_px;
  const double side_px = kSidePx + kSideRadii * radius_px;
  std::array<Eigen::Vector3f, kPieces> differences, lines;
  std::array<bool, kPieces> stands_out{};
  Eigen::Vector3f mean = Eigen::Vector3f::Zero();
  size_t seen = 0;
  for (size_t p = 0; p < pieces; ++p) {
    std::array<Eigen::Vector3f, 3> greys;  // left, line, right
    bool inside = true;
    for (size_t lane = 0; lane < 3 && inside; ++lane) {
      greys[lane].setZero();
      for (int i = 0; i < kAlong && inside; ++i) {
        const double share =
            (static_cast<double>(p) + (i + 0.5) / kAlong) / static_cast<double>(pieces);
        const Eigen::Vector2d at =
            from_px + share * way + (static_cast<double>(lane) - 1) * side_px * across;
        const auto x = static_cast<int>(std::lround(at.x()));
        const auto y = static_cast<int>(std::lround(at.y()));
        inside = x >= 0 && y >= 0 && x < image.width && y < image.height;
        if (inside) greys[lane] += GreyAt(image, x, y) / kAlong;
      }
    }
    if (!inside) continue;
    const Eigen::Vector3f left = greys[1] - greys[0], right = greys[1] - greys[2];
    // By the side that it differs from less.
    const float least = std::min(left.norm(), right.norm());
    const bool same_way = left.dot(right) > kAlikeColour * left.norm() * right.norm();
    stands_out[seen] = least > kLeastStickGrey;
    lines[seen] = greys[1];
    differences[seen] = Eigen::Vector3f::Zero();
    if (stands_out[seen] && same_way) differences[seen] = 0.5f * (left + right);
    mean += differences[seen];
    ++seen;
  }
  if (seen < kFewestPieces || 2 * seen < pieces) return 0;
  mean /= static_cast<float>(seen);
  // Before one background it differs from that alike, before several it is alike itself.
  const auto is_alike = [&](size_t i, size_t j) {
    const float apart = (lines[i] - lines[j]).norm();
    return stands_out[j] && apart < kLeastStickGrey + kSameGrey * lines[i].norm();
  };
  size_t alike = 0, same_line = 0;
  for (size_t i = 0; i < seen; ++i) {
    const float along = differences[i].dot(mean) / std::max(1e-3f, mean.norm());
    alike +=
        along > kLeastOfStick * mean.norm() && along > kAlikeColour * differences[i].norm() ? 1 : 0;
    size_t same = 0;
    for (size_t j = 0; j < seen; ++j) same += stands_out[i] && is_alike(i, j) ? 1 : 0;
    same_line = std::max(same_line, same);
  }
  alike = std::max(alike, same_line);
  return static_cast<double>(alike) / static_cast<double>(seen);
}

std::optional<double> StickBetween(const ImageView& image, const Eigen::Vector2d& a_px,
                                   double a_radius_px, const Eigen::Vector2d& b_px,
                                   double b_radius_px, double radius_px) {
  const Eigen::Vector2d way = b_px - a_px;
  const double begin = (kOffSphere * a_radius_px + kOffSpherePx) / way.norm();
  const double end = 1 - (kOffSphere * b_radius_px + kOffSpherePx) / way.norm();
  if (!(end > begin)) return std::nullopt;
  return StickShare(image, a_px + begin * way, a_px + end * way, radius_px);
}

}  // namespace rigcal::agent
