// SPDX-License-Identifier: Apache-2.0
#include "server/solve/bundle/envelope_cholesky.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cstdint>
#include <utility>

namespace rigcal::server {
namespace {

using Eigen::Index;

// Rows of a block of the factor: as many as matrix products need to be fast.
constexpr Index kBlock = 64;
// Up to here an order gains nothing.
constexpr Index kSmall = 4 * kBlock;
// Nodes with more neighbours than this share of all (lengths of the target) come last: they are in
// everybody's way.
constexpr double kShared = 0.5;
// Of the products of the whole factor: with more the whole one is as fast.
constexpr double kWorth = 0.5;

// Neighbouring rows that share their places that are not zero, such as those of one camera, are
// ordered together.
struct Node {
  Index first = 0;
  Index count = 0;
};

std::vector<Node> NodesOf(const Eigen::Ref<const Eigen::MatrixXd>& lower) {
  const auto size = static_cast<size_t>(lower.rows());
  // By row, of the places that are not zero.
  std::vector<uint64_t> marks(size), sums(size, 0);
  for (size_t i = 0; i < size; ++i) marks[i] = (i + 1) * 0x9e3779b97f4a7c15u;
  for (uint64_t& mark : marks) mark ^= (mark >> 29) * 0xbf58476d1ce4e5b9u;
  for (size_t column = 0; column < size; ++column) {
    const double* const values = lower.col(static_cast<Index>(column)).data();
    sums[column] += marks[column];
    for (size_t row = column + 1; row < size; ++row) {
      if (values[row] == 0) continue;
      sums[row] += marks[column];
      sums[column] += marks[row];
    }
  }
  std::vector<Node> nodes;
  for (size_t i = 0; i < size; ++i) {
    if (i > 0 && sums[i] == sums[i - 1]) {
      ++nodes.back().count;
    } else {
      nodes.push_back({static_cast<Index>(i), 1});
    }
  }
  return nodes;
}

using Graph = std::vector<std::vector<size_t>>;

// Which nodes have elements in common that are not zero.
Graph GraphOf(const Eigen::Ref<const Eigen::MatrixXd>& lower, const std::vector<Node>& nodes) {
  Graph graph(nodes.size());
  for (size_t b = 0; b < nodes.size(); ++b) {
    for (size_t a = b + 1; a < nodes.size(); ++a) {
      if (lower(nodes[a].first, nodes[b].first) == 0) continue;
      graph[a].push_back(b);
      graph[b].push_back(a);
    }
  }
  return graph;
}

// Nodes that can be reached from `start`, nearest first, of equally near ones that with the fewest
// neighbours first. Only those that are not `taken`.
std::vector<size_t> ByDistance(const Graph& graph, size_t start, std::vector<bool> taken) {
  std::vector<size_t> reached = {start};
  taken[start] = true;
  for (size_t i = 0; i < reached.size(); ++i) {
    const size_t begin = reached.size();
    for (const size_t next : graph[reached[i]]) {
      if (taken[next]) continue;
      taken[next] = true;
      reached.push_back(next);
    }
    std::stable_sort(reached.begin() + static_cast<std::ptrdiff_t>(begin), reached.end(),
                     [&graph](size_t a, size_t b) { return graph[a].size() < graph[b].size(); });
  }
  return reached;
}

// Reverse Cuthill-McKee; each part of the graph starts at a node far out.
std::vector<size_t> OrderNodes(const Graph& graph) {
  constexpr int kSteps = 2;
  std::vector<bool> taken(graph.size(), false);
  std::vector<size_t> shared, order;
  for (size_t node = 0; node < graph.size(); ++node) {
    if (static_cast<double>(graph[node].size()) <= kShared * static_cast<double>(graph.size())) {
      continue;
    }
    taken[node] = true;
    shared.push_back(node);
  }
  for (size_t node = 0; node < graph.size(); ++node) {
    if (taken[node]) continue;
    std::vector<size_t> part = ByDistance(graph, node, taken);
    for (int i = 0; i < kSteps; ++i) part = ByDistance(graph, part.back(), taken);
    for (const size_t own : part) taken[own] = true;
    order.insert(order.end(), part.begin(), part.end());
  }
  std::reverse(order.begin(), order.end());
  order.insert(order.end(), shared.begin(), shared.end());
  return order;
}

}  // namespace

EnvelopeCholesky::EnvelopeCholesky(const Eigen::Ref<const Eigen::MatrixXd>& lower)
    : size_(lower.rows()) {
  if (size_ > kSmall && Order(lower)) {
    Fill(lower);
    Factorise();
    return;
  }
  whole_ = lower;
  const Eigen::LLT<Eigen::Ref<Eigen::MatrixXd>, Eigen::Lower> factor(whole_);
  ok_ = factor.info() == Eigen::Success;
}

// False where the whole factor is as fast.
bool EnvelopeCholesky::Order(const Eigen::Ref<const Eigen::MatrixXd>& lower) {
  const std::vector<Node> nodes = NodesOf(lower);
  const Graph graph = GraphOf(lower, nodes);
  std::vector<Index> place(nodes.size());  // of each node's first row
  std::vector<Index> order;
  for (const size_t node : OrderNodes(graph)) {
    place[node] = static_cast<Index>(order.size());
    for (Index i = 0; i < nodes[node].count; ++i) order.push_back(nodes[node].first + i);
  }
  std::vector<Index> first(static_cast<size_t>((size_ + kBlock - 1) / kBlock));
  for (size_t b = 0; b < first.size(); ++b) first[b] = static_cast<Index>(b) * kBlock;
  for (size_t node = 0; node < nodes.size(); ++node) {
    Index nearest = place[node];
    for (const size_t other : graph[node]) nearest = std::min(nearest, place[other]);
    const Index last = place[node] + nodes[node].count - 1;
    for (Index b = place[node] / kBlock; b <= last / kBlock; ++b) {
      Index& own = first[static_cast<size_t>(b)];
      own = std::min(own, nearest / kBlock * kBlock);
    }
  }
  double products = 0, of_whole = 0;
  for (size_t b = 0; b < first.size(); ++b) {
    const double end = static_cast<double>(b) * kBlock;
    const double width = end - static_cast<double>(first[b]) + kBlock;
    products += width * width;
    of_whole += (end + kBlock) * (end + kBlock);
  }
  if (products > kWorth * of_whole) return false;
  order_ = std::move(order);
  first_ = std::move(first);
  return true;
}

Index EnvelopeCholesky::Count(size_t block) const {
  return std::min(kBlock, size_ - static_cast<Index>(block) * kBlock);
}

void EnvelopeCholesky::Fill(const Eigen::Ref<const Eigen::MatrixXd>& lower) {
  for (size_t b = 0; b < first_.size(); ++b) {
    const Index begin = static_cast<Index>(b) * kBlock;
    Eigen::MatrixXd& rows = rows_.emplace_back(Count(b), begin + Count(b) - first_[b]);
    for (Index j = 0; j < rows.cols(); ++j) {
      const Index column = order_[static_cast<size_t>(first_[b] + j)];
      for (Index i = 0; i < rows.rows(); ++i) {
        const Index row = order_[static_cast<size_t>(begin + i)];
        rows(i, j) = lower(std::max(row, column), std::min(row, column));
      }
    }
  }
}

void EnvelopeCholesky::Factorise() {
  for (size_t b = 0; b < rows_.size(); ++b) {
    Eigen::MatrixXd& own = rows_[b];
    for (auto other = static_cast<size_t>(first_[b] / kBlock); other <= b; ++other) {
      const Eigen::MatrixXd& above = rows_[other];
      const Index column = static_cast<Index>(other) * kBlock;
      const Index from = std::max(first_[b], first_[other]);
      auto block = own.middleCols(column - first_[b], Count(other));
      if (column > from) {
        block.noalias() -= own.middleCols(from - first_[b], column - from) *
                           above.middleCols(from - first_[other], column - from).transpose();
      }
      if (other < b) {
        above.rightCols(Count(other))
            .triangularView<Eigen::Lower>()
            .transpose()
            .solveInPlace<Eigen::OnTheRight>(block);
      }
    }
    const Eigen::LLT<Eigen::MatrixXd> factor(own.rightCols(Count(b)));
    if (factor.info() != Eigen::Success) return;
    own.rightCols(Count(b)) = factor.matrixL();
  }
  ok_ = true;
}

void EnvelopeCholesky::SolveInPlace(Eigen::MatrixXd* right) const {
  if (!is_reordered()) {
    whole_.triangularView<Eigen::Lower>().solveInPlace(*right);
    whole_.triangularView<Eigen::Lower>().transpose().solveInPlace(*right);
    return;
  }
  Eigen::MatrixXd solved = (*right)(order_, Eigen::all);
  for (size_t b = 0; b < rows_.size(); ++b) {
    const Index begin = static_cast<Index>(b) * kBlock;
    auto own = solved.middleRows(begin, Count(b));
    own.noalias() -=
        rows_[b].leftCols(begin - first_[b]) * solved.middleRows(first_[b], begin - first_[b]);
    rows_[b].rightCols(Count(b)).triangularView<Eigen::Lower>().solveInPlace(own);
  }
  for (size_t b = rows_.size(); b-- > 0;) {
    const Index begin = static_cast<Index>(b) * kBlock;
    auto own = solved.middleRows(begin, Count(b));
    rows_[b].rightCols(Count(b)).triangularView<Eigen::Lower>().transpose().solveInPlace(own);
    solved.middleRows(first_[b], begin - first_[b]).noalias() -=
        rows_[b].leftCols(begin - first_[b]).transpose() * own;
  }
  (*right)(order_, Eigen::all) = solved;
}

Eigen::VectorXd EnvelopeCholesky::Solve(const Eigen::VectorXd& right) const {
  if (!is_reordered()) {
    Eigen::VectorXd solved = right;
    whole_.triangularView<Eigen::Lower>().solveInPlace(solved);
    whole_.triangularView<Eigen::Lower>().transpose().solveInPlace(solved);
    return solved;
  }
  Eigen::MatrixXd solved = right;
  SolveInPlace(&solved);
  return solved.col(0);
}

Eigen::MatrixXd EnvelopeCholesky::Inverse() const {
  Eigen::MatrixXd inverse = Eigen::MatrixXd::Identity(size_, size_);
  SolveInPlace(&inverse);
  return inverse;
}

}  // namespace rigcal::server
