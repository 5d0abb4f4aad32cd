// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

namespace rigcal {

// The unit that a number of metres was perhaps meant in, where it is so many times as large as it
// should be: "millimetres" of about 1000, "centimetres", "inches", "feet"; empty: none fits within
// this share.
std::string UnitOfRatio(double ratio, double tolerance);

// How two lengths compare, for people: "3.000 % longer", "1000 times as long", "1/1000 as long".
// Percent only where they say something: of ratios from 1/2 to 2.
std::string DescribeRatio(double ratio);

}  // namespace rigcal
