// SPDX-License-Identifier: Apache-2.0
#include "server/solve/evaluate/moved_set.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <boost/math/distributions/chi_squared.hpp>
#include <boost/math/distributions/complement.hpp>
#include <limits>
#include <numeric>
#include <utility>

namespace rigcal::server {
namespace {

constexpr int kPoseRows = 6;
constexpr double kChance = 1e-7;
// Sets of one size that are looked at; more are searched one camera after the other.
constexpr double kMaxSets = 5000;
// A second set is as good where its squared distance is larger by no more than this.
constexpr double kAsGood = 20;

double Limit(size_t degrees) {
  return boost::math::quantile(
      boost::math::complement(boost::math::chi_squared(static_cast<double>(degrees)), kChance));
}

double Combinations(size_t n, size_t k) {
  double count = 1;
  for (size_t i = 0; i < k; ++i) count *= static_cast<double>(n - i) / static_cast<double>(i + 1);
  return count;
}

class Search {
 public:
  Search(const Eigen::VectorXd& difference, const Eigen::MatrixXd& covariance)
      : difference_(difference),
        covariance_(covariance),
        count_(static_cast<size_t>(difference.size() / kPoseRows)) {}

  MovedSet Run() {
    MovedSet result;
    std::vector<size_t> before;  // moved, best of the size before
    for (size_t moved = 0; moved + 2 <= count_; ++moved) {
      const std::vector<Candidate> candidates = OfSize(moved, before);
      before = candidates.front().moved;
      std::vector<const Candidate*> accepted;
      for (const Candidate& candidate : candidates) {
        if (accepted.size() < 2 && Accepts(candidate)) accepted.push_back(&candidate);
      }
      if (accepted.empty()) continue;
      if (accepted.size() > 1 && accepted[1]->squared - accepted[0]->squared <= kAsGood) break;
      result.moved = accepted[0]->moved;
      result.still = Rest(result.moved);
      return result;
    }
    result.still = Rest({});
    result.problem =
        "the cameras have moved against each other, and which of them kept their places cannot be "
        "told: fewer than two agree, or several groups do; calibrate the whole rig anew";
    return result;
  }

 private:
  struct Candidate {
    std::vector<size_t> moved;
    double squared = 0;  // Mahalanobis distance of the rest
  };

  std::vector<size_t> Rest(const std::vector<size_t>& moved) const {
    std::vector<size_t> rest;
    for (size_t c = 0; c < count_; ++c) {
      if (std::ranges::find(moved, c) == moved.end()) rest.push_back(c);
    }
    return rest;
  }

  double Squared(const std::vector<size_t>& cameras) const {
    std::vector<Eigen::Index> rows;
    for (const size_t c : cameras) {
      for (int i = 0; i < kPoseRows; ++i) rows.push_back(static_cast<Eigen::Index>(6 * c) + i);
    }
    const Eigen::VectorXd difference = difference_(rows);
    const Eigen::MatrixXd covariance = covariance_(rows, rows);
    const Eigen::LDLT<Eigen::MatrixXd> factor(covariance);
    const double squared = difference.dot(factor.solve(difference));
    return squared >= 0 ? squared : std::numeric_limits<double>::infinity();
  }

  // Best first. All of that size, or those that add one camera to the best of the size before.
  std::vector<Candidate> OfSize(size_t size, const std::vector<size_t>& before) const {
    std::vector<Candidate> candidates;
    const auto add = [&](std::vector<size_t> moved) {
      std::ranges::sort(moved);
      const double squared = Squared(Rest(moved));
      candidates.push_back({std::move(moved), squared});
    };
    if (Combinations(count_, size) <= kMaxSets) {
      std::vector<bool> chosen(count_, false);
      std::fill_n(chosen.begin(), size, true);
      do {
        std::vector<size_t> moved;
        for (size_t c = 0; c < count_; ++c) {
          if (chosen[c]) moved.push_back(c);
        }
        add(std::move(moved));
      } while (std::prev_permutation(chosen.begin(), chosen.end()));
    } else {
      for (const size_t c : Rest(before)) {
        std::vector<size_t> moved = before;
        moved.push_back(c);
        add(std::move(moved));
      }
    }
    std::ranges::sort(candidates, {}, &Candidate::squared);
    return candidates;
  }

  bool Accepts(const Candidate& candidate) const {
    const std::vector<size_t> still = Rest(candidate.moved);
    if (candidate.squared > Limit(kPoseRows * (still.size() - 1))) return false;
    return std::ranges::all_of(still, [&](size_t c) {
      std::vector<size_t> others = still;
      std::erase(others, c);
      return candidate.squared - Squared(others) <= Limit(kPoseRows);
    });
  }

  const Eigen::VectorXd& difference_;
  const Eigen::MatrixXd& covariance_;
  const size_t count_;
};

}  // namespace

MovedSet FindMovedSet(const Eigen::VectorXd& difference, const Eigen::MatrixXd& covariance) {
  return Search(difference, covariance).Run();
}

}  // namespace rigcal::server
