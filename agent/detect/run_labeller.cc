// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/run_labeller.h"

#include <algorithm>
#include <bit>

namespace rigcal::agent {
namespace {

constexpr int kWordBits = 64;
constexpr int32_t kNowhere = INT32_MAX;
constexpr int kNoRow = -2;

void Add(const ComponentSums& other, ComponentSums* sums) {
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

// Columns [begin, end) of row y. With n columns: sum x = n (begin + end - 1) / 2, and
// sum x^2 = n begin^2 + begin n (n - 1) + (n - 1) n (2 n - 1) / 6.
void AddRun(int64_t y, int64_t begin, int64_t end, ComponentSums* sums) {
  const int64_t n = end - begin;
  const int64_t sum_x = n * (begin + end - 1) / 2;
  sums->area += n;
  sums->x += sum_x;
  sums->y += n * y;
  sums->xx += begin * (n * begin + n * (n - 1)) + (n - 1) * n * (2 * n - 1) / 6;
  sums->xy += y * sum_x;
  sums->yy += n * y * y;
  sums->min_x = std::min(sums->min_x, static_cast<int32_t>(begin));
  sums->max_x = std::max(sums->max_x, static_cast<int32_t>(end - 1));
  sums->min_y = std::min(sums->min_y, static_cast<int32_t>(y));
  sums->max_y = static_cast<int32_t>(y);
}

}  // namespace

void RunLabeller::Start(int max_words) {
  const size_t max_runs = static_cast<size_t>(max_words) * (kWordBits / 2) + 2;
  if (row_.size() < max_runs) {
    row_.resize(max_runs);
    above_.resize(max_runs);
  }
  above_y_ = kNoRow;
  parent_.clear();
  sums_.clear();
}

int RunLabeller::FindRuns(int first_column, const uint64_t* words, int word_count) {
  Run* run = row_.data();
  bool open = false;  // the last run goes on into this word
  for (int i = 0; i < word_count; ++i) {
    const uint64_t word = words[i];
    if (!open && word == 0) continue;
    const int column = first_column + kWordBits * i;
    // A bit where a run begins or ends: the pixel differs from the one before.
    uint64_t edges = word ^ (word << 1 | (open ? 1 : 0));
    while (edges != 0) {
      const int edge = column + std::countr_zero(edges);
      edges &= edges - 1;
      if (open) {
        run->end = edge;
        ++run;
      } else {
        run->begin = edge;
      }
      open = !open;
    }
  }
  if (open) {
    run->end = first_column + kWordBits * word_count;
    ++run;
  }
  return static_cast<int>(run - row_.data());
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
  const Run* above = above_.data();
  for (int i = 0; i < run_count; ++i) {
    Run& run = row_[static_cast<size_t>(i)];
    while (above->end < run.begin) ++above;
    if (above->begin > run.end) {
      run.label = static_cast<int32_t>(parent_.size());
      parent_.push_back(run.label);
      sums_.emplace_back();
    } else {
      run.label = above->label;
      // A run above that reaches past this one may touch the next one too.
      while (above[1].begin <= run.end) run.label = Join(run.label, (++above)->label);
    }
    AddRun(y, run.begin, run.end, &sums_[static_cast<size_t>(run.label)]);
  }
}

void RunLabeller::AddRow(int y, int first_column, const uint64_t* words, int word_count) {
  const int run_count = FindRuns(first_column, words, word_count);
  if (run_count == 0) return;
  if (above_y_ != y - 1) above_[0] = {kNowhere, kNowhere, 0};
  Link(y, run_count);
  row_[static_cast<size_t>(run_count)] = {kNowhere, kNowhere, 0};
  row_.swap(above_);
  above_y_ = y;
}

const std::vector<ComponentSums>& RunLabeller::Finish() {
  // A label's parent is smaller, so by the time a label is reached its own sums are complete.
  for (size_t label = parent_.size(); label-- > 0;) {
    const auto parent = static_cast<size_t>(parent_[label]);
    if (parent != label) Add(sums_[label], &sums_[parent]);
  }
  size_t count = 0;
  for (size_t label = 0; label < parent_.size(); ++label) {
    if (parent_[label] == static_cast<int32_t>(label)) sums_[count++] = sums_[label];
  }
  sums_.resize(count);
  parent_.clear();
  return sums_;
}

}  // namespace rigcal::agent
