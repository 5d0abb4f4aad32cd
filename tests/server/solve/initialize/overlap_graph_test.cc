// SPDX-License-Identifier: Apache-2.0
#include "server/solve/initialize/overlap_graph.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>
#include <utility>

#include "tests/testing/status_matchers.h"

namespace rigcal::server::overlap_graph_test {
namespace {

using ::rigcal::testing::IsOk;
using ::rigcal::testing::StatusIs;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

using Pair = std::pair<int, int>;

OverlapGraph Graph(int cameras, const std::map<Pair, int>& shared) {
  OverlapGraph graph;
  const auto count = static_cast<size_t>(cameras);
  for (int c = 0; c < cameras; ++c)
    graph.cameras.push_back(std::string(1, static_cast<char>('a' + c)));
  graph.view_counts.assign(count, 1000);
  graph.shared_counts.assign(count, std::vector<int>(count, 0));
  for (const auto& [pair, value] : shared) {
    const auto a = static_cast<size_t>(pair.first), b = static_cast<size_t>(pair.second);
    graph.shared_counts[a][b] = graph.shared_counts[b][a] = value;
  }
  return graph;
}

// Poses whose translation names the pair; `share` of the views survive, all unless stated.
class Estimator {
 public:
  explicit Estimator(std::map<Pair, double> share = {}) : share_(std::move(share)) {}
  absl::StatusOr<std::optional<RelativePose>> operator()(int a, int b) {
    asked_.push_back({a, b});
    const auto found = share_.find({a, b});
    const double share = found == share_.end() ? 1 : found->second;
    if (share == 0) return std::optional<RelativePose>();
    RelativePose pose;
    pose.b_from_a.translation_m = {static_cast<double>(a), static_cast<double>(b), 0};
    pose.instant_count = 100;
    pose.inlier_count = static_cast<int>(100 * share);
    return std::optional<RelativePose>(pose);
  }
  const std::vector<Pair>& asked() const { return asked_; }

 private:
  std::map<Pair, double> share_;
  std::vector<Pair> asked_;
};

std::vector<Pair> PairsOf(const std::vector<OverlapEdge>& tree) {
  std::vector<Pair> pairs;
  for (const OverlapEdge& edge : tree) pairs.push_back({edge.a, edge.b});
  return pairs;
}

TEST(FindSpanningTree, OfOneCameraOrNoneIsEmpty) {
  for (const int cameras : {0, 1}) {
    Estimator estimator;
    ASSERT_OK_AND_ASSIGN(const auto tree,
                         FindSpanningTree(Graph(cameras, {}), std::ref(estimator)));
    EXPECT_TRUE(tree.empty());
    EXPECT_TRUE(estimator.asked().empty());
  }
}

TEST(FindSpanningTree, TakesTheHeaviestEdgesAndLooksAtNoOther) {
  Estimator estimator;
  ASSERT_OK_AND_ASSIGN(
      const auto tree,
      FindSpanningTree(
          Graph(4, {{{0, 1}, 50}, {{1, 2}, 90}, {{0, 2}, 80}, {{2, 3}, 20}, {{0, 3}, 30}}),
          std::ref(estimator)));
  EXPECT_EQ(PairsOf(tree), (std::vector<Pair>{{1, 2}, {0, 2}, {0, 3}}));
  EXPECT_EQ(estimator.asked(), PairsOf(tree));
  // Each edge carries its own pair's pose.
  for (const OverlapEdge& edge : tree) {
    EXPECT_EQ(edge.pose.b_from_a.translation_m, Eigen::Vector3d(edge.a, edge.b, 0));
  }
}

TEST(FindSpanningTree, AnEdgeThatLosesItsViewsGivesWayToALighterOne) {
  Estimator estimator({{{0, 1}, 0.2}});
  ASSERT_OK_AND_ASSIGN(
      const auto tree,
      FindSpanningTree(Graph(3, {{{0, 1}, 90}, {{1, 2}, 80}, {{0, 2}, 60}}), std::ref(estimator)));
  EXPECT_EQ(PairsOf(tree), (std::vector<Pair>{{1, 2}, {0, 2}}));
}

TEST(FindSpanningTree, AnEdgeWithoutAPoseIsNoEdge) {
  Estimator estimator({{{0, 1}, 0.0}});
  ASSERT_OK_AND_ASSIGN(
      const auto tree,
      FindSpanningTree(Graph(3, {{{0, 1}, 90}, {{1, 2}, 80}, {{0, 2}, 8}}), std::ref(estimator)));
  EXPECT_EQ(PairsOf(tree), (std::vector<Pair>{{1, 2}, {0, 2}}));
}

TEST(FindSpanningTree, OfEqualEdgesTakesTheLowestNames) {
  Estimator estimator;
  ASSERT_OK_AND_ASSIGN(
      const auto tree,
      FindSpanningTree(
          Graph(4, {{{0, 1}, 9}, {{0, 2}, 9}, {{0, 3}, 9}, {{1, 2}, 9}, {{1, 3}, 9}, {{2, 3}, 9}}),
          std::ref(estimator)));
  EXPECT_EQ(PairsOf(tree), (std::vector<Pair>{{0, 1}, {0, 2}, {0, 3}}));
}

TEST(FindSpanningTree, NamesTheGroupsAndThePairThatWouldBestJoinThem) {
  OverlapGraph graph = Graph(4, {{{0, 1}, 50}, {{2, 3}, 50}, {{1, 2}, 5}, {{0, 3}, 7}});
  graph.notes = {"", "", "sees little", ""};
  Estimator estimator;
  EXPECT_THAT(FindSpanningTree(graph, std::ref(estimator)),
              StatusIs(absl::StatusCode::kFailedPrecondition,
                       AllOf(HasSubstr("{a, b} and {c (sees little), d}"),
                             HasSubstr("a and d would best join them"),
                             HasSubstr("they share 7 wand views"), HasSubstr("at least 8"))));
  // Too few shared views are not looked at.
  EXPECT_EQ(estimator.asked(), (std::vector<Pair>{{0, 1}, {2, 3}}));
}

TEST(FindSpanningTree, AvoidsAnEdgeUnlessNothingElseJoins) {
  OverlapGraph graph = Graph(4, {{{0, 1}, 90}, {{1, 2}, 80}, {{0, 2}, 8}, {{2, 3}, 10}});
  graph.avoided = {{0, 1}, {2, 3}};
  Estimator estimator;
  ASSERT_OK_AND_ASSIGN(const auto tree, FindSpanningTree(graph, std::ref(estimator)));
  EXPECT_EQ(PairsOf(tree), (std::vector<Pair>{{1, 2}, {0, 2}, {2, 3}}));
}

TEST(FindSpanningTree, SaysThatSharedViewsDidNotAgree) {
  Estimator estimator({{{0, 1}, 0.0}});
  EXPECT_THAT(FindSpanningTree(Graph(2, {{{0, 1}, 400}}), std::ref(estimator)),
              StatusIs(absl::StatusCode::kFailedPrecondition,
                       HasSubstr("they share 400 wand views, of which 0 agree")));
}

TEST(FindSpanningTree, CamerasThatShareNothingAreAllNamed) {
  Estimator estimator;
  EXPECT_THAT(FindSpanningTree(Graph(3, {}), std::ref(estimator)),
              StatusIs(absl::StatusCode::kFailedPrecondition,
                       AllOf(HasSubstr("3 groups"), HasSubstr("{a} and {b} and {c}"))));
}

TEST(FindSpanningTree, PassesOnTheErrorOfAnEstimate) {
  const auto cancelled = [](int, int) -> absl::StatusOr<std::optional<RelativePose>> {
    return absl::CancelledError("enough");
  };
  EXPECT_THAT(FindSpanningTree(Graph(2, {{{0, 1}, 50}}), cancelled),
              StatusIs(absl::StatusCode::kCancelled, HasSubstr("enough")));
}

}  // namespace
}  // namespace rigcal::server::overlap_graph_test
