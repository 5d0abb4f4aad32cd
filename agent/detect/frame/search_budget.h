// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace rigcal::agent {

// What the search of an image may still cost, by what was done and not by a clock, so that it is
// the same on every computer. A wand in a room takes a twentieth of it.
class SearchBudget {
 public:
  void StartImage() { *this = SearchBudget(); }

  // Of wands to spots.
  int fits() const { return kMostFits - fits_left_; }
  int fits_left() const { return fits_left_; }
  void UseFits(int count) { fits_left_ -= count; }

  // In pixels that are read (MarkerMeter::WorkOf). Below 0: the last look cost more than was left.
  double work_left() const { return work_left_; }
  // What was taken of it, at most `most`; what is left of that goes back. `least`: for the last
  // look at a wand that is found, whatever is left.
  double TakeWork(double most, double least = 0);
  void GiveBackWork(double work) { work_left_ += work; }

  // Of all, where finding spots took `spots_ms` so far.
  double EstimatedMs(double spots_ms) const;
  // Leaves as much work as there is time for: spots and work together have a limit.
  void CutWork(double spots_ms);

 private:
  static constexpr int kMostFits = 500;
  static constexpr double kMostWork = 28000;

  double MsWithoutWork(double spots_ms) const;

  int fits_left_ = kMostFits;
  double work_left_ = kMostWork;
  double work_cut_ = 0;  // taken away, not used
};

}  // namespace rigcal::agent
