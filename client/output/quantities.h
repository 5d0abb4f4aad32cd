// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <google/protobuf/generated_enum_reflection.h>
#include <google/protobuf/timestamp.pb.h>

#include <string>

namespace rigcal::client {

// How quantities are written for people.

// With so many digits after the point; never "-0.000"; "nan" and "inf" as such.
std::string FormatFixed(double value, int digits);
// Local time with its zone, to the second: "2026-05-01 14:03:07 CEST"; "-" for a time that is not set.
std::string FormatTime(bool is_set, const google::protobuf::Timestamp& time);
// "0.82 s", "3 min 20 s".
std::string FormatDuration(double seconds);
// "1 camera", "4 cameras".
std::string FormatCount(uint64_t count, const char* singular);
// "12 KiB", "1.2 GiB".
std::string FormatBytes(uint64_t bytes);

// "clock_offset" for FINDING_KIND_CLOCK_OFFSET; "finding_kind 99" for UNSPECIFIED and for a value
// of a later version.
std::string EnumWord(const google::protobuf::EnumDescriptor& type, int value);
template <typename Enum>
std::string EnumWord(Enum value) {
  return EnumWord(*google::protobuf::GetEnumDescriptor<Enum>(), value);
}

double DegreesFromRadians(double radians);

// Four digits, or all before the point: "-495.9", "0.05231", "-1000000".
std::string FormatMagnitude(double value);
// The headline of a calibration and of a running estimate: "0.29 mm + 0.69 % of every length".
std::string FormatPointError(double point_error_m, double scale_sigma_rel);
// "measure the wand to 0.2 mm for a better scale"; empty: the scale is good, or no wand has
// lengths.
std::string FormatScaleAdvice(double scale_sigma_rel, double wand_length_m);

}  // namespace rigcal::client
