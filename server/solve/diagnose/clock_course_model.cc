// SPDX-License-Identifier: Apache-2.0
#include "server/solve/diagnose/clock_course_model.h"

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

namespace rigcal::server {
namespace {

// Added to each block's sigma: what interpolation leaves.
constexpr double kFloorS = 1e-4;
constexpr double kMinSizeS = 1.5e-3, kCourseSigmas = 5;
// Of the scatter about a constant must go.
constexpr double kMustExplain = 0.7;

// Blocks as a linear function of time, whose unit is half the recording.
struct Model {
  CourseKind kind = CourseKind::kConstant;
  int degree = 0;
  int parameters = 1;
  double chi2 = 0;
  size_t split = 0;                // of a step: first block after it
  Eigen::VectorXd coefficients;    // of the powers of time, then of the step
  double size_s = 0, sigma_s = 0;  // sigma by the blocks' own
};

double WeightOf(const CourseBlock& block) {
  return 1 / (block.sigma_s * block.sigma_s + kFloorS * kFloorS);
}

// A polynomial, and where `split` is not 0 a step before that block; the block before which the
// step is belongs to neither side where `skip` is set. None where the blocks do not determine it.
std::optional<Model> FitModel(const std::vector<CourseBlock>& blocks, double middle_s,
                              double half_s, int degree, size_t split, bool skip) {
  Model model;
  model.kind = split > 0     ? CourseKind::kStep
               : degree == 0 ? CourseKind::kConstant
               : degree == 1 ? CourseKind::kSlope
                             : CourseKind::kCurve;
  model.degree = degree;
  model.split = split;
  const Eigen::Index columns = degree + 1 + (split > 0 ? 1 : 0);
  // The place of a step is chosen, too.
  model.parameters = static_cast<int>(columns) + (split > 0 ? 1 : 0) + (skip ? 1 : 0);
  const auto basis = [&](size_t b) {
    Eigen::VectorXd row(columns);
    for (int i = 0; i <= degree; ++i) row[i] = std::pow((blocks[b].time_s - middle_s) / half_s, i);
    if (split > 0) row[columns - 1] = b >= split ? 1 : 0;
    return row;
  };
  const auto counts = [&](size_t b) { return !skip || b != split; };
  Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(columns, columns);
  Eigen::VectorXd right = Eigen::VectorXd::Zero(columns);
  for (size_t b = 0; b < blocks.size(); ++b) {
    if (!counts(b)) continue;
    const Eigen::VectorXd row = basis(b);
    normal += WeightOf(blocks[b]) * row * row.transpose();
    right += WeightOf(blocks[b]) * blocks[b].offset_s * row;
  }
  const Eigen::LDLT<Eigen::MatrixXd> factor(normal);
  if (!factor.isPositive()) return std::nullopt;
  model.coefficients = factor.solve(right);
  if (!model.coefficients.allFinite()) return std::nullopt;
  size_t least = 0, largest = 0;
  for (size_t b = 0; b < blocks.size(); ++b) {
    const double offset_s = basis(b).dot(model.coefficients);
    if (counts(b)) model.chi2 += WeightOf(blocks[b]) * std::pow(blocks[b].offset_s - offset_s, 2);
    if (offset_s < basis(least).dot(model.coefficients)) least = b;
    if (offset_s > basis(largest).dot(model.coefficients)) largest = b;
  }
  Eigen::VectorXd between = basis(largest) - basis(least);
  if (split > 0) between = Eigen::VectorXd::Unit(columns, columns - 1);
  model.size_s = between.dot(model.coefficients);
  model.sigma_s = std::sqrt(std::max(0.0, between.dot(factor.solve(between))));
  return model;
}

}  // namespace

void ChooseCourseModel(const std::vector<CourseBlock>& blocks, ClockCourse* course) {
  const double begin_s = blocks.front().time_s, end_s = blocks.back().time_s;
  course->middle_s = 0.5 * (begin_s + end_s);
  const double half_s = std::max(1e-3, 0.5 * (end_s - begin_s));
  std::vector<Model> models;
  const size_t count = blocks.size();
  const auto add = [&](int degree, size_t split, bool skip) {
    const auto model = FitModel(blocks, course->middle_s, half_s, degree, split, skip);
    if (model) models.push_back(*model);
  };
  for (int degree = 0; degree <= 2; ++degree) add(degree, 0, false);
  for (int degree = 0; degree <= 1; ++degree) {
    const auto beside = static_cast<size_t>(2 + degree);
    for (size_t split = beside; split + beside <= count; ++split) {
      add(degree, split, false);
      if (split + beside < count) add(degree, split, true);
    }
  }
  if (models.empty() || models.front().kind != CourseKind::kConstant) return;
  const auto scatter = [count](const Model& model) {
    const double freedom = std::max(1.0, static_cast<double>(count) - model.parameters);
    return std::max(1.0, model.chi2 / freedom);
  };
  double least = std::numeric_limits<double>::infinity();
  for (const Model& model : models) least = std::min(least, scatter(model));
  const auto criterion = [&](const Model& model) {
    return model.chi2 / least + model.parameters * std::log(static_cast<double>(count));
  };
  const Model& best = *std::ranges::min_element(models, {}, criterion);
  const double sigma_s = best.sigma_s * std::sqrt(scatter(best));
  const bool significant = best.kind != CourseKind::kConstant &&
                           std::abs(best.size_s) > std::max(kMinSizeS, kCourseSigmas * sigma_s) &&
                           best.chi2 < (1 - kMustExplain) * models.front().chi2;
  if (!significant) return;
  course->kind = best.kind;
  course->size_s = best.size_s;
  course->sigma_s = sigma_s;
  course->step_time_s = best.split > 0 ? blocks[best.split].time_s : 0;
  for (int i = 0; i <= best.degree; ++i) {
    course->coefficients.push_back(best.coefficients[i] / std::pow(half_s, i));
  }
}

}  // namespace rigcal::server
