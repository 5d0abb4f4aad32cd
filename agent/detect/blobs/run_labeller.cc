// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/blobs/run_labeller.h"

#include <algorithm>
#include <bit>
#include <utility>

namespace rigcal::agent {
namespace {

constexpr int kWordBits = 64;
constexpr int32_t kNowhere = INT32_MAX;
constexpr int kNoRow = -2;

inline __attribute__((always_inline)) void Add(const ComponentSums& other, ComponentSums* sums) {
  sums->area += other.area;
  sums->x += other.x;
  sums->y += other.y;
  sums->xx += other.xx;
  sums->xy += other.xy;
  sums->yy += other.yy;
  sums->min_x = std::min(sums->min_x, other.min_x);
  sums->max_x = std::max(sums->max_x, other.max_x);
  sums->min_y = std::min(sums->min_y, other.min_y);
  sums->max_y = std::max(sums->max_y, other.max_y);
}

// Sums over columns [begin, end) of row y. With n columns: sum x = n (begin + end - 1) / 2, and
// sum x^2 = n begin (end - 1) + (n - 1) n (2 n - 1) / 6.
inline __attribute__((always_inline)) ComponentSums SumsOf(uint64_t y, uint64_t begin,
                                                           uint64_t end) {
  const uint64_t n = end - begin;
  const uint64_t sum_x = n * (begin + end - 1) / 2, sum_y = n * y;
  ComponentSums sums;
  sums.area = static_cast<int64_t>(n);
  sums.x = static_cast<int64_t>(sum_x);
  sums.y = static_cast<int64_t>(sum_y);
  sums.xx = static_cast<int64_t>(n * begin * (end - 1) + (n - 1) * n * (2 * n - 1) / 6);
  sums.xy = static_cast<int64_t>(y * sum_x);
  sums.yy = static_cast<int64_t>(sum_y * y);
  sums.min_x = static_cast<int32_t>(begin);
  sums.max_x = static_cast<int32_t>(end - 1);
  sums.min_y = sums.max_y = static_cast<int32_t>(y);
  return sums;
}

}  // namespace

void RunLabeller::Start(int max_words) {
  const size_t max_runs = static_cast<size_t>(max_words) * (kWordBits / 2) + 1;
  if (row_.labels.size() < max_runs) {
    for (Row* row : {&row_, &above_}) {
      row->edges.resize(2 * max_runs);
      row->labels.resize(max_runs);
    }
  }
  above_y_ = kNoRow;
  run_count_ = 0;
  label_count_ = 0;
}

int RunLabeller::FindRuns(int first_column, const uint64_t* words, int word_count) {
  int32_t* const edges = row_.edges.data();
  int32_t* next = edges;
  uint64_t last = 0;  // the last pixel of the word before
  for (int i = 0; i < word_count; ++i) {
    const uint64_t word = words[i];
    // A bit is set where a pixel differs from the one before: runs begin and end there by turns.
    uint64_t changes = word ^ (word << 1 | last);
    last = word >> (kWordBits - 1);
    const int column = first_column + kWordBits * i;
    for (; changes != 0; changes &= changes - 1) *next++ = column + std::countr_zero(changes);
  }
  if (last != 0) *next++ = first_column + kWordBits * word_count;
  next[0] = next[1] = kNowhere;
  return static_cast<int>((next - edges) / 2);
}

int32_t RunLabeller::Root(int32_t label) {
  int32_t* parent = parent_.data();
  while (parent[label] != label) {
    parent[label] = parent[parent[label]];
    label = parent[label];
  }
  return label;
}

int32_t RunLabeller::Join(int32_t a, int32_t b) {
  a = Root(a);
  b = Root(b);
  const int32_t root = std::min(a, b);
  parent_[static_cast<size_t>(std::max(a, b))] = root;
  return root;
}

void RunLabeller::Link(int y, int run_count) {
  // Each run may become a component of its own.
  const auto most = static_cast<size_t>(label_count_ + run_count);
  if (parent_.size() < most) {
    parent_.resize(2 * most);
    sums_.resize(2 * most);
  }
  int32_t* const parent = parent_.data();
  ComponentSums* const sums = sums_.data();
  const int32_t* const edges = row_.edges.data();
  int32_t* const labels = row_.labels.data();
  const int32_t* above = above_.edges.data();
  const int32_t* above_label = above_.labels.data();
  for (int i = 0; i < run_count; ++i) {
    const int32_t begin = edges[2 * i], end = edges[2 * i + 1];
    const ComponentSums own =
        SumsOf(static_cast<uint64_t>(y), static_cast<uint64_t>(begin), static_cast<uint64_t>(end));
    for (; above[1] < begin; above += 2) ++above_label;
    if (above[0] > end) {
      const int32_t label = label_count_++;
      parent[label] = labels[i] = label;
      sums[label] = own;
      continue;
    }
    int32_t label = *above_label;
    // A run above that reaches past this one may touch the next one too.
    for (; above[2] <= end; above += 2) label = Join(label, *++above_label);
    labels[i] = label;
    Add(own, &sums[label]);
  }
}

void RunLabeller::AddRow(int y, int first_column, const uint64_t* words, int word_count) {
  const int run_count = FindRuns(first_column, words, word_count);
  if (run_count == 0) return;
  run_count_ += run_count;
  if (above_y_ != y - 1) above_.edges[0] = above_.edges[1] = kNowhere;
  Link(y, run_count);
  std::swap(row_, above_);
  above_y_ = y;
}

const std::vector<ComponentSums>& RunLabeller::Finish() {
  // A label's parent is smaller, so a label's own sums are complete when the loop reaches it.
  const auto count = static_cast<size_t>(label_count_);
  for (size_t label = count; label-- > 0;) {
    const auto parent = static_cast<size_t>(parent_[label]);
    if (parent != label) Add(sums_[label], &sums_[parent]);
  }
  found_.clear();
  for (size_t label = 0; label < count; ++label) {
    if (parent_[label] == static_cast<int32_t>(label)) found_.push_back(sums_[label]);
  }
  label_count_ = 0;
  return found_;
}

}  // namespace rigcal::agent
