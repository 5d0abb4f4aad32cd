# SPDX-License-Identifier: Apache-2.0
# How this project declares libraries, programs and tests, so that each folder's list stays short.

set(CMAKE_CXX_STANDARD 20)
set(CMAKE_CXX_STANDARD_REQUIRED ON)
set(CMAKE_CXX_EXTENSIONS OFF)
set(CMAKE_EXPORT_COMPILE_COMMANDS ON)
set(CMAKE_RUNTIME_OUTPUT_DIRECTORY ${PROJECT_BINARY_DIR}/bin)
set(CMAKE_ARCHIVE_OUTPUT_DIRECTORY ${PROJECT_BINARY_DIR}/lib)

option(RIGCAL_WARNINGS_AS_ERRORS "Treat compiler warnings as errors" OFF)
set(RIGCAL_SANITIZE "" CACHE STRING "Sanitizers to build with, e.g. address,undefined or thread")

find_program(CCACHE_PROGRAM ccache)
if(CCACHE_PROGRAM)
  set(CMAKE_CXX_COMPILER_LAUNCHER ${CCACHE_PROGRAM})
endif()

add_library(rigcal_build_flags INTERFACE)
target_compile_options(rigcal_build_flags INTERFACE -Wall -Wextra -Wconversion -Wshadow
  $<$<BOOL:${RIGCAL_WARNINGS_AS_ERRORS}>:-Werror>)
# gcc 12 sees overlapping copies in std::string that cannot happen (GCC bug 105651).
target_compile_options(rigcal_build_flags INTERFACE $<$<CXX_COMPILER_ID:GNU>:-Wno-restrict>)
# One answer to a*b+c on every machine: a calibration must not change with the compiler's taste for FMA.
target_compile_options(rigcal_build_flags INTERFACE -ffp-contract=off)
if(RIGCAL_SANITIZE)
  target_compile_options(rigcal_build_flags INTERFACE -fsanitize=${RIGCAL_SANITIZE}
    -fno-omit-frame-pointer -fno-sanitize-recover=all)
  target_link_options(rigcal_build_flags INTERFACE -fsanitize=${RIGCAL_SANITIZE})
endif()

# rigcal_library(<name> SOURCES ... [DEPS ...] [PRIVATE_DEPS ...]): library rigcal_<name>, alias rigcal::<name>.
function(rigcal_library name)
  cmake_parse_arguments(ARG "" "" "SOURCES;DEPS;PRIVATE_DEPS" ${ARGN})
  add_library(rigcal_${name} STATIC ${ARG_SOURCES})
  add_library(rigcal::${name} ALIAS rigcal_${name})
  target_include_directories(rigcal_${name} PUBLIC ${PROJECT_SOURCE_DIR})
  target_link_libraries(rigcal_${name} PUBLIC ${ARG_DEPS}
    PRIVATE rigcal_build_flags ${ARG_PRIVATE_DEPS})
endfunction()

# rigcal_header_library(<name> [DEPS ...]): the same for a folder with headers only.
function(rigcal_header_library name)
  cmake_parse_arguments(ARG "" "" "DEPS" ${ARGN})
  add_library(rigcal_${name} INTERFACE)
  add_library(rigcal::${name} ALIAS rigcal_${name})
  target_include_directories(rigcal_${name} INTERFACE ${PROJECT_SOURCE_DIR})
  target_link_libraries(rigcal_${name} INTERFACE ${ARG_DEPS})
endfunction()

# rigcal_program(<file name> SOURCES ... DEPS ...): a program in build/<preset>/bin.
function(rigcal_program name)
  cmake_parse_arguments(ARG "" "" "SOURCES;DEPS" ${ARGN})
  add_executable(${name} ${ARG_SOURCES})
  target_link_libraries(${name} PRIVATE ${ARG_DEPS} rigcal_build_flags)
endfunction()

# rigcal_test(<path> [SOURCES ...] DEPS ... [TIMEOUT s] [PROGRAMS ...]): the test tests/<path>.cc, named <path> in CTest.
# PROGRAMS are targets that must be built before the test runs.
function(rigcal_test path)
  cmake_parse_arguments(ARG "" "TIMEOUT" "SOURCES;DEPS;PROGRAMS;LABELS" ${ARGN})
  string(REPLACE "/" "." target ${path})
  add_executable(${target} ${PROJECT_SOURCE_DIR}/tests/${path}.cc ${ARG_SOURCES})
  set_target_properties(${target} PROPERTIES RUNTIME_OUTPUT_DIRECTORY ${PROJECT_BINARY_DIR}/tests)
  target_compile_definitions(${target} PRIVATE
    RIGCAL_SOURCE_DIR="${PROJECT_SOURCE_DIR}" RIGCAL_BIN_DIR="${CMAKE_RUNTIME_OUTPUT_DIRECTORY}")
  target_link_libraries(${target} PRIVATE ${ARG_DEPS} rigcal::testing GTest::gmock GTest::gtest_main
    rigcal_build_flags)
  if(ARG_PROGRAMS)
    add_dependencies(${target} ${ARG_PROGRAMS})
  endif()
  if(NOT ARG_TIMEOUT)
    set(ARG_TIMEOUT 120)
  endif()
  add_test(NAME ${path} COMMAND ${target})
  set_tests_properties(${path} PROPERTIES TIMEOUT ${ARG_TIMEOUT} LABELS "${ARG_LABELS}"
    SKIP_REGULAR_EXPRESSION "\\[  SKIPPED \\]"
    ENVIRONMENT "OMP_THREAD_LIMIT=1")
endfunction()

# rigcal_bench(<name> [SOURCES ...] DEPS ...): tests/bench/<name>.cc, built as tests/bench.<name>; run by hand.
function(rigcal_bench name)
  cmake_parse_arguments(ARG "" "" "SOURCES;DEPS" ${ARGN})
  add_executable(bench.${name} ${PROJECT_SOURCE_DIR}/tests/bench/${name}.cc ${ARG_SOURCES})
  set_target_properties(bench.${name} PROPERTIES RUNTIME_OUTPUT_DIRECTORY ${PROJECT_BINARY_DIR}/tests)
  target_link_libraries(bench.${name} PRIVATE ${ARG_DEPS} rigcal::testing benchmark::benchmark
    rigcal_build_flags)
endfunction()
