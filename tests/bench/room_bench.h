// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "tests/bench/suites.h"

namespace rigcal::bench {

// The whole detector of wands, one thread, single images without tracking: 36 rendered frames of
// three rooms of each kind of `rigcal-accuracy detection`, two thirds of them with a wand.
//   detect/room/<room>/Detector   counters: median and worst CPU time of a frame (the shortest of
//   its
//                            runs), share of the wands found, false wands
//   detect/room/<room>/OpenCv     OpenCV's chain (BGR2HSV, inRange, findContours, moments) with the
//   best
//                            three blobs in line and with the wand's ratio
void RegisterRooms();

// How many times longer OpenCV's chain takes in rooms in which it finds half of the wands.
void PrintRoomRatios(const MeasuredTimes& times);

}  // namespace rigcal::bench
