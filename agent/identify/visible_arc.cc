// SPDX-License-Identifier: Apache-2.0
#include "agent/identify/visible_arc.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numbers>

namespace rigcal::agent {
namespace {

constexpr int kGapRounds = 4;
constexpr size_t kLongestGap = 9;              // sectors
constexpr double kGapCost = 2, kGapGain = 14;  // chi-squared: of a sector, of any gap
constexpr double kMostOfGain = 0.85, kMostLeft = 10;
constexpr double kLeastDepthPx = 0.1;                       // of a gap's edges, inwards
constexpr double kLeastInformation = 0.2;                   // of a sector, of the mean
constexpr double kStillInside = 2;                          // sigmas
constexpr double kEdgeFloorPx = 0.02, kFloorShare = 0.002;  // of a sector's edge; of the radius

using Sectors = std::array<bool, kOutlineSectors>;

size_t SectorOf(const OutlinePixels& pixels, size_t i, const SphereOutline& outline) {
  return OutlineSector(static_cast<double>(pixels.x[i]) - outline.centre_px.x(),
                       static_cast<double>(pixels.y[i]) - outline.centre_px.y());
}

// Edges by sector: how far outwards of the outline, and one over the variance.
struct SectorEdges {
  std::array<double, kOutlineSectors> away_px{}, weight{};
};

// A fit that is robust hardly sees the pixels of a hidden sector, so here they count like others.
// Edges further out are something beside the sphere, and as the robust fit sees them.
SectorEdges EdgesOf(const OutlinePixels& pixels, const SphereOutline& outline,
                    const ArcExpectation& expected, OutlineRows* rows) {
  const Eigen::Matrix<float, kOutlineCount, 1> single = outline.parameters.cast<float>();
  rows->ModelEdge(pixels, single.data(), outline.white);
  std::array<double, kOutlineSectors> score{}, information{};
  for (size_t i = 0; i < pixels.size(); ++i) {
    // Before a saturated background any sphere looks smaller, and the stick tells nothing.
    if (!(pixels.precision[i] > 0) || pixels.saturated_behind[i] > 0 ||
        (!pixels.stick_side.empty() && pixels.stick_side[i] != 0)) {
      continue;
    }
    const size_t s = SectorOf(pixels, i, outline);
    const double slope = static_cast<double>(rows->slope(kOutlineRadius, i) * pixels.precision[i]);
    // What is darker than the background hides no more of it.
    const float covered = std::max(0.0f, pixels.coverage[i]);
    score[s] += slope * static_cast<double>((covered - rows->value(i)) * pixels.precision[i]);
    information[s] += slope * slope;
  }
  double mean = 0;
  for (const double one : information) mean += one / kOutlineSectors;
  const double floor_px = kEdgeFloorPx + kFloorShare * outline.radius_px;
  SectorEdges edges;
  for (size_t s = 0; s < kOutlineSectors; ++s) {
    if (!(information[s] > kLeastInformation * mean)) continue;
    edges.away_px[s] = score[s] / information[s];
    if (edges.away_px[s] > 0) {
      const double robust = outline.sector_information[s];
      edges.away_px[s] = robust > 0 ? std::max(0.0, outline.sector_score[s] / robust) : 0;
    }
    edges.weight[s] =
        1 / (expected.scatter / information[s] + floor_px * floor_px + expected.edge_variance_px2);
  }
  return edges;
}

// Place, radius and stretch of an ellipse near the outline, in first order.
using Step = Eigen::Matrix<double, 5, 1>;

std::array<Step, kOutlineSectors> SectorRows() {
  std::array<Step, kOutlineSectors> rows;
  for (size_t s = 0; s < kOutlineSectors; ++s) {
    const double turn = (static_cast<double>(s) + 0.5) / kOutlineSectors - 0.5;
    const double angle = 2 * std::numbers::pi * turn;
    rows[s] << std::cos(angle), std::sin(angle), 1, std::cos(2 * angle), std::sin(2 * angle);
  }
  return rows;
}

class GapSearch {
 public:
  GapSearch(const SphereOutline& outline, const SectorEdges& edges, const ArcExpectation& expected)
      : edges_(edges) {
    prior_ = Step::Constant(1e-9);
    if (expected.radius_px > 0) {
      prior_[2] = 1 / (expected.radius_sigma_px * expected.radius_sigma_px);
      missing_[2] = expected.radius_px - outline.radius_px;
    }
    const double sigma_px = expected.stretch_sigma * outline.radius_px;
    prior_.tail<2>().setConstant(1 / (sigma_px * sigma_px));
    missing_.tail<2>() = (expected.stretch - outline.stretch) * outline.radius_px;
    for (size_t s = 0; s < kOutlineSectors; ++s) {
      all_ += edges.weight[s] * rows_[s] * rows_[s].transpose();
      gradient_ += edges.weight[s] * edges.away_px[s] * rows_[s];
    }
    double depth_px = 0;
    whole_ = Fit(0, 0, &depth_px);
  }

  // The chi-squared without `count` sectors from `first` on, and how far in those are.
  double Fit(size_t first, size_t count, double* depth_px) const {
    Eigen::Matrix<double, 5, 5> information = all_;
    Step gradient = gradient_ + prior_.cwiseProduct(missing_);
    information.diagonal() += prior_;
    for (size_t i = 0; i < count; ++i) {
      const size_t s = (first + i) % kOutlineSectors;
      information -= edges_.weight[s] * rows_[s] * rows_[s].transpose();
      gradient -= edges_.weight[s] * edges_.away_px[s] * rows_[s];
    }
    const Step step = information.llt().solve(gradient);
    double cost = (step - missing_).cwiseAbs2().dot(prior_), deep = 0, weights = 0;
    for (size_t i = 0; i < kOutlineSectors; ++i) {
      const size_t s = (first + i) % kOutlineSectors;
      const double residual = edges_.away_px[s] - rows_[s].dot(step);
      if (i < count) {
        deep -= edges_.weight[s] * residual;
        weights += edges_.weight[s];
      } else {
        cost += edges_.weight[s] * residual * residual;
      }
    }
    *depth_px = weights > 0 ? deep / weights : 0;
    return cost;
  }

  double whole_chi_squared() const { return whole_; }

  // None of them where no gap is much better.
  Sectors Best() const {
    // No gap can explain more than there is.
    if (whole_ < kGapGain + kGapCost) return {};
    struct Gap {
      double gain = 0;
      size_t first = 0;
    };
    std::array<Gap, kLongestGap + 1> gaps;
    double best = 0, depth_px = 0;
    for (size_t length = 1; length <= kLongestGap; ++length) {
      for (size_t s = 0; s < kOutlineSectors; ++s) {
        const double gain =
            whole_ - Fit(s, length, &depth_px) - kGapCost * static_cast<double>(length);
        if (gain > gaps[length].gain && depth_px > kLeastDepthPx) gaps[length] = {gain, s};
      }
      best = std::max(best, gaps[length].gain);
    }
    // The shortest one that explains most of it: an ellipse through few sectors fits anything.
    size_t first = 0, count = 0;
    for (size_t length = 1; length <= kLongestGap && count == 0 && best > kGapGain; ++length) {
      if (gaps[length].gain > std::max(kMostOfGain * best, best - kMostLeft)) {
        first = gaps[length].first, count = length;
      }
    }
    Sectors gap{};
    for (size_t i = 0; i < count; ++i) gap[(first + i) % kOutlineSectors] = true;
    return gap;
  }

 private:
  const SectorEdges& edges_;
  const std::array<Step, kOutlineSectors> rows_ = SectorRows();
  Step prior_ = Step::Zero(), missing_ = Step::Zero(), gradient_ = Step::Zero();
  Eigen::Matrix<double, 5, 5> all_ = Eigen::Matrix<double, 5, 5>::Zero();
  double whole_ = 0;  // the chi-squared with all sectors
};

void LeaveOut(const OutlinePixels& pixels, const SphereOutline& outline, const Sectors& hidden,
              OutlinePixels* others) {
  *others = pixels;
  for (size_t i = 0; i < pixels.size(); ++i) {
    if (hidden[SectorOf(pixels, i, outline)]) others->precision[i] = 0;
  }
}

// What hides a sphere is blurred, too: next to a gap a little is hidden.
Sectors WithNeighbours(const Sectors& hidden) {
  Sectors wider = hidden;
  for (size_t s = 0; s < kOutlineSectors; ++s) {
    if (!hidden[s]) continue;
    wider[(s + 1) % kOutlineSectors] = true;
    wider[(s + kOutlineSectors - 1) % kOutlineSectors] = true;
  }
  return wider;
}

void CountKnown(const SectorEdges& edges, VisibleArc* arc) {
  arc->known_count = 0;
  arc->missing.setZero();
  for (size_t s = 0; s < kOutlineSectors; ++s) {
    const bool is_known = edges.weight[s] > 0 && !arc->hidden[s];
    arc->known_count += is_known ? 1 : 0;
    if (!is_known) arc->missing += SectorRows()[s].head<2>() / kOutlineSectors;
  }
}

}  // namespace

VisibleArc FindVisibleArc(const OutlinePixels& pixels, const Eigen::Matrix2d& second_moment_px2,
                          const SphereShading& light, const ArcExpectation& expected,
                          SphereOutlineFitter* fitter, SphereOutline* outline) {
  VisibleArc arc;
  SphereOutline now = *outline;
  OutlineRows rows;
  OutlineExpectation shape;
  shape.stretch = expected.stretch;
  shape.stretch_sigma = expected.stretch_sigma;
  shape.radius_px = expected.radius_px;
  shape.radius_sigma_px = expected.radius_sigma_px;
  for (int round = 0; round < kGapRounds; ++round) {
    const SectorEdges edges = EdgesOf(pixels, now, expected, &rows);
    const GapSearch search(now, edges, expected);
    if (round == 0) arc.whole_chi_squared = search.whole_chi_squared();
    Sectors hidden = search.Best();
    // Where it was hidden, and nothing says that it is not.
    for (size_t s = 0; s < kOutlineSectors; ++s) {
      hidden[s] |=
          arc.hidden[s] &&
          !(edges.away_px[s] * std::sqrt(edges.weight[s]) > -kStillInside && edges.weight[s] > 0);
    }
    arc.stays = hidden == arc.hidden && !(expected.is_cut && round == 0);
    arc.hidden = hidden;
    CountKnown(edges, &arc);
    if (arc.stays) break;
    LeaveOut(pixels, now, hidden, &arc.pixels);
    SphereOutline again = now;
    if (!fitter->Fit(arc.pixels, second_moment_px2, light, &again, shape)) {
      arc.failed = true;
      break;
    }
    fitter->MeasureEdge(pixels, &again);
    now = again;
  }
  arc.hidden_count = static_cast<int>(std::count(arc.hidden.begin(), arc.hidden.end(), true));
  if ((arc.is_all() && !expected.is_cut) || arc.failed) return arc;
  if (!arc.is_all()) {
    arc.hidden = WithNeighbours(arc.hidden);
    CountKnown(EdgesOf(pixels, now, expected, &rows), &arc);
    LeaveOut(pixels, now, arc.hidden, &arc.pixels);
    SphereOutline again = now;
    if (fitter->Fit(arc.pixels, second_moment_px2, light, &again, shape)) now = again;
  }
  LeaveOut(pixels, now, arc.hidden, &arc.pixels);
  fitter->MeasureEdge(arc.pixels, &now);
  arc.moved_px = (now.centre_px - outline->centre_px).norm();
  *outline = now;
  return arc;
}

}  // namespace rigcal::agent
