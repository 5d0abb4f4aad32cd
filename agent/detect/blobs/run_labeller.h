// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

namespace rigcal::agent {

// Sums over the pixels of one component, in pixels of the image.
struct ComponentSums {
  int64_t area = 0;
  int64_t x = 0;
  int64_t y = 0;
  int64_t xx = 0;
  int64_t xy = 0;
  int64_t yy = 0;
  int32_t min_x = INT32_MAX;
  int32_t max_x = INT32_MIN;
  int32_t min_y = INT32_MAX;
  int32_t max_y = INT32_MIN;
};

// Joins mask pixels that touch (8 neighbours) to components, row by row from the top. Rows are cut
// into runs of pixels; runs that touch a run of the row above get its label, and labels that meet
// are joined (union-find). Buffers are kept from image to image.
class RunLabeller {
 public:
  // Forgets the last image. Rows that follow have at most `max_words` words.
  void Start(int max_words);

  // Row y, below all rows before; rows left out are empty. Bit k of word i is column
  // first_column + 64 * i + k.
  void AddRow(int y, int first_column, const uint64_t* words, int word_count);

  // Runs of all rows since Start; the time goes with it.
  int64_t run_count() const { return run_count_; }

  // Sums of each component, in the order of their first pixels from top to bottom, left to right.
  // Valid until the next call.
  const std::vector<ComponentSums>& Finish();

 private:
  // The runs of a row. Run i covers columns [edges[2 i], edges[2 i + 1]); behind the last one
  // stands one that nothing touches.
  struct Row {
    std::vector<int32_t> edges;
    std::vector<int32_t> labels;
  };

  // Returns how many runs went into row_.
  int FindRuns(int first_column, const uint64_t* words, int word_count);
  void Link(int y, int run_count);
  int32_t Root(int32_t label);
  int32_t Join(int32_t a, int32_t b);

  Row above_;  // row above_y_
  Row row_;
  int above_y_ = 0;
  int64_t run_count_ = 0;
  int32_t label_count_ = 0;
  std::vector<int32_t> parent_;      // by label, never larger than the label
  std::vector<ComponentSums> sums_;  // by label
  std::vector<ComponentSums> found_;
};

}  // namespace rigcal::agent
