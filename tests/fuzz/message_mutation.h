// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <google/protobuf/descriptor.h>
#include <google/protobuf/message.h>

#include <cmath>
#include <cstdint>
#include <limits>
#include <string>

#include "tests/fuzz/fuzz_input.h"

namespace rigcal::testing {

namespace pb = ::google::protobuf;

inline std::string FuzzText(FuzzInput* input) {
  // Names that sessions, cameras and agents of these tests have, and what nothing may be called.
  static const std::string texts[] = {"",
                                      "wave",
                                      "second",
                                      "left",
                                      "right",
                                      "rig",
                                      "pc1",
                                      "pc2",
                                      "c-000001",
                                      "s-000001",
                                      "none",
                                      "../wave",
                                      "a/b",
                                      "wave\n2026",
                                      "\x1b[2J",
                                      "\xff\xfe",
                                      "\xe2\x80\xae",
                                      "' OR 1=1",
                                      "create_time desc",
                                      "state=CAPTURING",
                                      "rig=rig AND state=FINISHED",
                                      "%s%n",
                                      std::string(65, 'x'),
                                      std::string(257, 'y'),
                                      std::string(5000, 'z'),
                                      std::string(3, '\0')};
  constexpr size_t kCount = sizeof(texts) / sizeof(texts[0]);
  const uint8_t choice = input->Byte();
  if (choice < 2 * kCount) return texts[choice % kCount];
  std::string text;
  for (int i = choice % 8; i >= 0; --i) text.push_back(static_cast<char>(input->Byte()));
  return text;
}

inline uint64_t FuzzInteger(FuzzInput* input) {
  static const uint64_t values[] = {0,
                                    1,
                                    2,
                                    3,
                                    8192,
                                    8193,
                                    INT32_MAX,
                                    uint64_t{1} << 31,
                                    UINT32_MAX,
                                    UINT64_MAX,
                                    INT64_MAX,
                                    uint64_t{1} << 63,
                                    uint64_t{1} << 62,
                                    uint64_t{1} << 32};
  constexpr size_t kCount = sizeof(values) / sizeof(values[0]);
  const uint8_t choice = input->Byte();
  return choice < 8 * kCount ? values[choice % kCount] : input->Word16();
}

inline double FuzzReal(FuzzInput* input) {
  static const double values[] = {0,    -0.0, 1,     -1,  0.13,     1e-300,
                                  1e30, -1e9, 1e300, NAN, INFINITY, -INFINITY};
  constexpr size_t kCount = sizeof(values) / sizeof(values[0]);
  const uint8_t choice = input->Byte();
  return choice < 12 * kCount ? values[choice % kCount] : input->Word16() / 16.0;
}

void MutateMessage(FuzzInput* input, pb::Message* message, int depth);

// One more element of a repeated field, or the value of a single one.
inline void SetFuzzValue(FuzzInput* input, pb::Message* message, const pb::FieldDescriptor* field,
                         int depth) {
  using Field = pb::FieldDescriptor;
  const pb::Reflection& reflection = *message->GetReflection();
  const bool repeated = field->is_repeated();
  const auto set = [&](auto add, auto assign, auto value) {
    if (repeated) {
      (reflection.*add)(message, field, value);
    } else {
      (reflection.*assign)(message, field, value);
    }
  };
  using R = pb::Reflection;
  switch (field->cpp_type()) {
    case Field::CPPTYPE_INT32:
      return set(&R::AddInt32, &R::SetInt32, static_cast<int32_t>(FuzzInteger(input)));
    case Field::CPPTYPE_INT64:
      return set(&R::AddInt64, &R::SetInt64, static_cast<int64_t>(FuzzInteger(input)));
    case Field::CPPTYPE_UINT32:
      return set(&R::AddUInt32, &R::SetUInt32, static_cast<uint32_t>(FuzzInteger(input)));
    case Field::CPPTYPE_UINT64:
      return set(&R::AddUInt64, &R::SetUInt64, FuzzInteger(input));
    case Field::CPPTYPE_DOUBLE:
      return set(&R::AddDouble, &R::SetDouble, FuzzReal(input));
    case Field::CPPTYPE_FLOAT:
      return set(&R::AddFloat, &R::SetFloat, static_cast<float>(FuzzReal(input)));
    case Field::CPPTYPE_BOOL:
      return set(&R::AddBool, &R::SetBool, (input->Byte() & 1) != 0);
    case Field::CPPTYPE_ENUM: {
      const int value = input->Byte();
      return set(&R::AddEnumValue, &R::SetEnumValue, value < 128 ? value : value * 1'000'003 - 1);
    }
    case Field::CPPTYPE_STRING:
      return set(&R::AddString, &R::SetString, FuzzText(input));
    case Field::CPPTYPE_MESSAGE:
      MutateMessage(input,
                    repeated ? reflection.AddMessage(message, field)
                             : reflection.MutableMessage(message, field),
                    depth + 1);
  }
}

inline void MutateRepeated(FuzzInput* input, pb::Message* message, const pb::FieldDescriptor* field,
                           int depth) {
  const pb::Reflection& reflection = *message->GetReflection();
  const int size = reflection.FieldSize(*message, field);
  const uint8_t how = input->Byte();
  switch (how % 6) {
    case 0:
      return reflection.ClearField(message, field);
    case 1:
      if (size > 0) reflection.RemoveLast(message, field);
      return;
    case 2:
      if (size > 1) reflection.SwapElements(message, field, 0, how % size);
      return;
    case 3:
      if (size > 0 && field->cpp_type() == pb::FieldDescriptor::CPPTYPE_MESSAGE) {
        MutateMessage(input, reflection.MutableRepeatedMessage(message, field, how % size), depth);
      }
      return;
    case 4:  // many of the same
      for (int i = 1 << how % 13; i > 0; --i) {
        FuzzInput same = *input;
        SetFuzzValue(&same, message, field, depth + 2);
      }
      return;
    default:
      SetFuzzValue(input, message, field, depth);
  }
}

// Changes one field, somewhere in the message, as the input says.
inline void MutateMessage(FuzzInput* input, pb::Message* message, int depth) {
  const pb::Descriptor& type = *message->GetDescriptor();
  if (type.field_count() == 0 || depth > 6) return;
  const pb::FieldDescriptor* field = type.field(input->Byte() % type.field_count());
  if (field->is_repeated()) return MutateRepeated(input, message, field, depth);
  if (input->Byte() % 5 == 0) return message->GetReflection()->ClearField(message, field);
  SetFuzzValue(input, message, field, depth);
}

}  // namespace rigcal::testing
