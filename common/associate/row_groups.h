// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace rigcal {

// The rows of one camera in which it sees something, on the common time scale of the rig. A camera
// may have several of these (one for each epoch of its clock).
struct RowTimes {
  std::string camera;
  double frame_period_s = 0;     // median time between its frames; 0: not known
  std::vector<int64_t> time_ns;  // rig time, in any order
  std::vector<int> row;          // the number of each of them
};

struct RowMember {
  int64_t time_ns = 0;
  int track = 0;  // index of its RowTimes
  int row = 0;
};

// Rows of one moment, at least one, one per camera.
using RowGroup = std::vector<RowMember>;

struct RowGrouping {
  std::vector<RowGroup> groups;    // not in the order of time where cameras differ in rate
  std::vector<RowMember> skipped;  // there is a nearer one of the same camera
};

// Groups rows of several cameras that belong to one moment. The same rows give the same groups
// whatever their order was.
//
// All members of a group lie within `tolerance_s` of each other. 0: from the cameras' periods.
// Cameras that run together: a quarter of the smallest period, the widest that cannot mix
// neighbouring frames. Where that leaves most rows alone, or most of one camera's, the cameras run
// freely: then a group takes what lies within one period of the slowest camera, of each camera the
// row nearest its middle, and the caller moves each row to the group's time.
//
// That is for cameras of about one rate. Of much faster ones (event cameras at 200 Hz beside frame
// cameras at 50 that run together) the row nearest to each group of the slow ones joins it, and
// what they saw in between makes groups among the fast cameras in the same way.
RowGrouping GroupRows(const std::vector<RowTimes>& tracks, double tolerance_s);

// The mean of its rows' times.
int64_t MeanTimeNs(const RowGroup& group);

}  // namespace rigcal
