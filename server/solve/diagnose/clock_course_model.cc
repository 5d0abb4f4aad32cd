// SPDX-License-Identifier: Apache-2.0
#include "server/solve/diagnose/clock_course_model.h"

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <optional>
#include <utility>

namespace rigcal::server {
namespace {

// Added to each block's sigma: what interpolation leaves.
constexpr double kFloorS = 1e-4;
constexpr double kMinSizeS = 1.5e-3, kCourseSigmas = 5;
// Several breaks are the best of very many placements.
constexpr double kBreaksSigmas = 8;
// Of the scatter about a constant must go, and with each further break of what is left.
constexpr double kMustExplain = 0.7;
constexpr size_t kMaxBreaks = 3;
constexpr int kCornerRounds = 2, kCornerSteps = 8;
// Blocks between two breaks, and more of them than parameters.
constexpr size_t kMinBlocksBetween = 2, kMinFreedom = 3;
// Columns of a model: straight line and breaks, or a parabola.
constexpr int kMaxColumns = 2 + static_cast<int>(kMaxBreaks);

using Vector = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kMaxColumns, 1>;
using Matrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kMaxColumns, kMaxColumns>;

// A step or a corner: between two blocks, or within the one at `block`, which then counts for
// neither side.
struct Break {
  size_t block = 0;  // first one after it
  bool within = false;
  double after_s = 0;  // of a corner: its time, from that of the block
};

// Blocks as a linear function of time, whose unit is half the recording.
struct Model {
  CourseKind kind = CourseKind::kConstant;
  int degree = 0;
  std::vector<Break> breaks;
  int parameters = 1;
  double chi2 = 0;
  Vector coefficients;  // of the powers of time, then of the breaks
  Vector sigmas;        // of them, by the blocks' own
  double size_s = 0, sigma_s = 0;
};

class CourseFit {
 public:
  explicit CourseFit(const std::vector<CourseBlock>& blocks)
      : blocks_(blocks),
        middle_s_(0.5 * (blocks.front().time_s + blocks.back().time_s)),
        half_s_(std::max(1e-3, 0.5 * (blocks.back().time_s - blocks.front().time_s))) {}

  double middle_s() const { return middle_s_; }
  double half_s() const { return half_s_; }
  // Of a break, in seconds.
  double BreakTimeS(const Break& at) const { return blocks_[at.block].time_s + at.after_s; }

  // Its corners where they fit best, between the blocks around them.
  Model WithFinerCorners(Model model) const {
    if (model.kind != CourseKind::kCorners) return model;
    for (int round = 0; round < kCornerRounds; ++round) {
      for (size_t i = 0; i < model.breaks.size(); ++i) {
        const size_t block = model.breaks[i].block;
        for (int k = 1 - kCornerSteps; k < kCornerSteps; ++k) {
          std::vector<Break> breaks = model.breaks;
          const size_t next = k < 0 ? block - 1 : std::min(block + 1, blocks_.size() - 1);
          breaks[i].after_s =
              std::abs(k) * (blocks_[next].time_s - blocks_[block].time_s) / kCornerSteps;
          std::optional<Model> finer = Fit(model.kind, model.degree, std::move(breaks));
          if (finer && finer->chi2 < model.chi2) model = *std::move(finer);
        }
      }
    }
    return model;
  }

  // None where the blocks do not determine it.
  std::optional<Model> Fit(CourseKind kind, int degree, std::vector<Break> breaks) const {
    Model model;
    model.kind = kind;
    model.degree = degree;
    model.breaks = std::move(breaks);
    const Eigen::Index columns = degree + 1 + static_cast<Eigen::Index>(model.breaks.size());
    // The place of a break is chosen, too.
    model.parameters = static_cast<int>(columns);
    for (const Break& at : model.breaks) model.parameters += at.within ? 2 : 1;
    Matrix normal = Matrix::Zero(columns, columns);
    Vector right = Vector::Zero(columns);
    for (size_t b = 0; b < blocks_.size(); ++b) {
      if (!Counts(model, b)) continue;
      const Vector row = BasisOf(model, b);
      normal += WeightOf(b) * row * row.transpose();
      right += WeightOf(b) * blocks_[b].offset_s * row;
    }
    const Eigen::LDLT<Matrix> factor(normal);
    if (factor.info() != Eigen::Success || !factor.isPositive()) return std::nullopt;
    model.coefficients = factor.solve(right);
    model.sigmas = factor.solve(Matrix::Identity(columns, columns)).diagonal().cwiseSqrt();
    if (!model.coefficients.allFinite() || !model.sigmas.allFinite()) return std::nullopt;
    size_t least = 0, largest = 0;
    for (size_t b = 0; b < blocks_.size(); ++b) {
      const double offset_s = OffsetOf(model, b);
      if (Counts(model, b)) {
        model.chi2 += WeightOf(b) * std::pow(blocks_[b].offset_s - offset_s, 2);
      }
      if (offset_s < OffsetOf(model, least)) least = b;
      if (offset_s > OffsetOf(model, largest)) largest = b;
    }
    if (kind == CourseKind::kSteps) {
      Eigen::Index i = 0;
      model.size_s = model.coefficients.tail(columns - degree - 1).cwiseAbs().maxCoeff(&i);
      model.size_s = model.coefficients[degree + 1 + i];
      model.sigma_s = model.sigmas[degree + 1 + i];
    } else {
      const Vector between = BasisOf(model, largest) - BasisOf(model, least);
      model.size_s = between.dot(model.coefficients);
      model.sigma_s = std::sqrt(std::max(0.0, between.dot(factor.solve(between))));
    }
    return model;
  }

  // Of the blocks about a model, as a multiple of their own sigmas squared.
  double ScatterOf(const Model& model) const {
    const double freedom = static_cast<double>(blocks_.size()) - model.parameters;
    return std::max(1.0, model.chi2 / std::max(1.0, freedom));
  }

 private:
  double WeightOf(size_t b) const {
    return 1 / (blocks_[b].sigma_s * blocks_[b].sigma_s + kFloorS * kFloorS);
  }
  double TimeOf(size_t b) const { return (blocks_[b].time_s - middle_s_) / half_s_; }
  static bool Counts(const Model& model, size_t b) {
    return std::ranges::none_of(model.breaks,
                                [b](const Break& at) { return at.within && at.block == b; });
  }
  Vector BasisOf(const Model& model, size_t b) const {
    Vector row(model.degree + 1 + static_cast<Eigen::Index>(model.breaks.size()));
    for (int i = 0; i <= model.degree; ++i) row[i] = std::pow(TimeOf(b), i);
    Eigen::Index column = model.degree;
    for (const Break& at : model.breaks) {
      const double since = (blocks_[b].time_s - BreakTimeS(at)) / half_s_;
      row[++column] = model.kind == CourseKind::kCorners ? std::max(0.0, since) : since >= 0;
    }
    return row;
  }
  double OffsetOf(const Model& model, size_t b) const {
    return BasisOf(model, b).dot(model.coefficients);
  }

  const std::vector<CourseBlock>& blocks_;
  double middle_s_, half_s_;
};

// Calls `add` with every placement of `count` breaks that leaves `beside` blocks at both ends.
void ForEachPlacement(size_t blocks, size_t count, size_t beside, bool may_be_within,
                      const std::function<void(const std::vector<Break>&)>& add) {
  std::vector<Break> breaks;
  const std::function<void(size_t)> place = [&](size_t from) {
    if (breaks.size() == count) {
      add(breaks);
      return;
    }
    for (size_t block = from; block + beside <= blocks; ++block) {
      for (const bool within : {false, true}) {
        if (within && (!may_be_within || block + beside >= blocks)) continue;
        breaks.push_back({block, within, 0});
        place(block + kMinBlocksBetween + (within ? 1 : 0));
        breaks.pop_back();
      }
    }
  };
  place(beside);
}

// The best of the models with `count` breaks, by the Bayesian information criterion.
std::optional<Model> BestWith(const CourseFit& fit, size_t blocks, size_t count) {
  std::vector<Model> models;
  const auto add = [&](CourseKind kind, int degree, const std::vector<Break>& breaks) {
    std::optional<Model> model = fit.Fit(kind, degree, breaks);
    if (!model) return;
    // What has many breaks is believed with data to spare only.
    if (count > 1 && blocks < static_cast<size_t>(model->parameters) + kMinFreedom) return;
    models.push_back(*std::move(model));
  };
  if (count == 0) {
    add(CourseKind::kConstant, 0, {});
    add(CourseKind::kSlope, 1, {});
    add(CourseKind::kCurve, 2, {});
  } else {
    for (const int degree : {0, 1}) {
      ForEachPlacement(blocks, count, static_cast<size_t>(2 + degree), true,
                       [&](const auto& breaks) { add(CourseKind::kSteps, degree, breaks); });
    }
    ForEachPlacement(blocks, count, 2, false,
                     [&](const auto& breaks) { add(CourseKind::kCorners, 1, breaks); });
  }
  double least = std::numeric_limits<double>::infinity();
  for (const Model& model : models) least = std::min(least, fit.ScatterOf(model));
  const auto criterion = [&](const Model& model) {
    return model.chi2 / least + model.parameters * std::log(static_cast<double>(blocks));
  };
  if (models.empty()) return std::nullopt;
  return *std::ranges::min_element(models, {}, criterion);
}

// Each of its steps, or the whole drift.
bool IsSignificant(const CourseFit& fit, const Model& model) {
  if (model.kind == CourseKind::kConstant) return false;
  const double scatter = std::sqrt(fit.ScatterOf(model));
  const double sigmas = model.breaks.size() > 1 ? kBreaksSigmas : kCourseSigmas;
  const auto large = [&](double size_s, double sigma_s) {
    return std::abs(size_s) > std::max(kMinSizeS, sigmas * sigma_s * scatter);
  };
  if (!large(model.size_s, model.sigma_s)) return false;
  for (Eigen::Index i = model.degree + 1; i < model.coefficients.size(); ++i) {
    if (model.kind == CourseKind::kSteps && !large(model.coefficients[i], model.sigmas[i])) {
      return false;
    }
    if (std::abs(model.coefficients[i]) < sigmas * model.sigmas[i] * scatter) return false;
  }
  return true;
}

}  // namespace

void ChooseCourseModel(const std::vector<CourseBlock>& blocks, ClockCourse* course) {
  const auto [least, largest] = std::ranges::minmax(blocks, {}, &CourseBlock::offset_s);
  if (largest.offset_s - least.offset_s < kMinSizeS) return;
  const CourseFit fit(blocks);
  const std::optional<Model> constant = fit.Fit(CourseKind::kConstant, 0, {});
  if (!constant) return;
  Model best = *constant;
  const double log_count = std::log(static_cast<double>(blocks.size()));
  const auto explains_more = [&](const Model& model, const Model& than) {
    const double least_scatter = std::min(fit.ScatterOf(model), fit.ScatterOf(than));
    const auto criterion = [&](const Model& of) {
      return of.chi2 / least_scatter + of.parameters * log_count;
    };
    return criterion(model) < criterion(than);
  };
  for (size_t breaks = 0; breaks <= kMaxBreaks; ++breaks) {
    const std::optional<Model> model = BestWith(fit, blocks.size(), breaks);
    if (!model || !explains_more(*model, best)) {
      // One more may do: two steps may take each other back.
      if (breaks < 2) continue;
      break;
    }
    if (!IsSignificant(fit, *model)) continue;
    if (breaks > 1 && model->chi2 >= (1 - kMustExplain) * best.chi2) continue;
    best = *model;
  }
  best = fit.WithFinerCorners(std::move(best));
  if (best.kind == CourseKind::kConstant || best.chi2 >= (1 - kMustExplain) * constant->chi2) {
    return;
  }
  const double scatter = std::sqrt(fit.ScatterOf(best));
  course->kind = best.kind;
  course->size_s = best.size_s;
  course->sigma_s = best.sigma_s * scatter;
  course->middle_s = fit.middle_s();
  for (int i = 0; i <= best.degree; ++i) {
    course->coefficients.push_back(best.coefficients[i] / std::pow(fit.half_s(), i));
  }
  for (size_t i = 0; i < best.breaks.size(); ++i) {
    const double time_s = fit.BreakTimeS(best.breaks[i]);
    const Eigen::Index column = best.degree + 1 + static_cast<Eigen::Index>(i);
    if (best.kind == CourseKind::kSteps) {
      course->steps.push_back({time_s, best.coefficients[column], best.sigmas[column] * scatter});
    } else {
      course->corners.push_back({time_s, best.coefficients[column] / fit.half_s()});
    }
  }
}

}  // namespace rigcal::server
