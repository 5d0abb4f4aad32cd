// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

namespace rigcal::agent {

// Sums over the pixels of one component; coordinates are pixels of the image.
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

// Joins mask pixels that touch (8 neighbours) into components, row by row from the top. Rows are
// cut into runs of pixels; a run takes the label of a run that it touches in the row above, and
// labels that meet are joined (union-find). Buffers are kept from image to image.
class RunLabeller {
 public:
  // Forgets the last image. The rows that follow have at most `max_words` words.
  void Start(int max_words);

  // Adds row y, which lies below all rows before; rows that are left out are empty. Bit k of word i
  // is column first_column + 64 * i + k.
  void AddRow(int y, int first_column, const uint64_t* words, int word_count);

  // Runs since Start; the time that the labeller takes goes with their number.
  int64_t run_count() const { return run_count_; }

  // Returns the sums of each component, in the order of their first pixels from top to bottom, left
  // to right. They are valid until the next call.
  const std::vector<ComponentSums>& Finish();

 private:
  // Run i of a row covers columns [edges[2 i], edges[2 i + 1]); a sentinel follows the last one.
  struct Row {
    std::vector<int32_t> edges;
    std::vector<int32_t> labels;
  };

  // Fills row_ and returns its number of runs.
  int FindRuns(int first_column, const uint64_t* words, int word_count);
  void Link(int y, int run_count);
  int32_t Root(int32_t label);
  int32_t Join(int32_t a, int32_t b);

  Row above_;  // the runs of row above_y_
  Row row_;
  int above_y_ = 0;
  int64_t run_count_ = 0;
  int32_t label_count_ = 0;
  std::vector<int32_t> parent_;      // by label; not larger than the label
  std::vector<ComponentSums> sums_;  // by label
  std::vector<ComponentSums> found_;
};

}  // namespace rigcal::agent
