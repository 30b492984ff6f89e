# SPDX-License-Identifier: Apache-2.0
# Compile options for all targets, and functions that add libraries, plugins and tests.

# Makes paths relative to the clone, so that all clones can share one compiler cache.
find_program(CCACHE ccache)
if(CCACHE)
  set(CMAKE_CXX_COMPILER_LAUNCHER env CCACHE_BASEDIR=${CMAKE_SOURCE_DIR} CCACHE_NOHASHDIR=1
                                      CCACHE_SLOPPINESS=pch_defines,time_macros ${CCACHE})
  set(CMAKE_C_COMPILER_LAUNCHER ${CMAKE_CXX_COMPILER_LAUNCHER})
endif()

find_package(PkgConfig REQUIRED)
find_package(Threads REQUIRED)

add_compile_options(-Wall -Wextra -Wpedantic -Werror)
if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU" AND CMAKE_CXX_COMPILER_VERSION VERSION_LESS 13)
  # GCC 12 falsely reports overlapping copies in std::string's operator+ (GCC bug 105651).
  add_compile_options(-Wno-restrict)
endif()
# These options make pixels and poses reproducible on every machine and at every call site.
add_compile_options(-ffp-contract=off)
if(ARHOST_SANITIZE)
  add_compile_options(-fsanitize=${ARHOST_SANITIZE} -fno-omit-frame-pointer -fno-sanitize-recover=all)
  add_link_options(-fsanitize=${ARHOST_SANITIZE})
endif()
# Options for tests and the conformance suite. Omits the sanitizers' pointer checks, which reduces compile time to a third.
set(ARHOST_UNCHECKED_POINTERS)
if(ARHOST_SANITIZE MATCHES undefined)
  set(ARHOST_UNCHECKED_POINTERS -fno-sanitize=null,alignment,vptr,object-size)
endif()

# Uses the folder layout of an installed arhost, so that the programs find each other.
set(ARHOST_PLUGIN_DIRECTORY ${CMAKE_BINARY_DIR}/lib/arhost/plugins)
add_custom_target(plugins COMMENT "All plugins")

# arhost_add_library(name SOURCES … [LIBRARIES …]): a module of core/, included as "module/header.hpp".
function(arhost_add_library name)
  cmake_parse_arguments(ARG "" "" "SOURCES;LIBRARIES" ${ARGN})
  add_library(${name} STATIC ${ARG_SOURCES})
  target_include_directories(${name} PUBLIC ${CMAKE_SOURCE_DIR}/core)
  target_link_libraries(${name} PUBLIC ${ARG_LIBRARIES})
endfunction()

# arhost_add_plugin(name SOURCES … [LIBRARIES …]): the same function as in the SDK. A plugin sees only the C ABI and
# the shading headers of core/.
include(${CMAKE_CURRENT_LIST_DIR}/arhost_add_plugin.cmake)

# arhost_scale_timeout(variable): multiplies a number of seconds with the environment variable ARHOST_TEST_TIME_SCALE,
# which also scales the limits in the tests (tests/support/waiting.hpp). Rounds up the scale.
function(arhost_scale_timeout variable)
  if("$ENV{ARHOST_TEST_TIME_SCALE}" MATCHES "^([0-9]+)(\\.[0-9]*)?$")
    set(scale ${CMAKE_MATCH_1})
    if("${CMAKE_MATCH_2}" MATCHES "[1-9]")
      math(EXPR scale "${scale} + 1")
    endif()
    if(scale GREATER 0)
      math(EXPR scaled "${${variable}} * ${scale}")
      set(${variable} ${scaled} PARENT_SCOPE)
    endif()
  endif()
endfunction()

# arhost_add_test_program(name SOURCES … [LIBRARIES …] [DEPENDS targets…]): a GoogleTest program that another command runs.
function(arhost_add_test_program name)
  cmake_parse_arguments(ARG "" "" "SOURCES;LIBRARIES;DEPENDS" ${ARGN})
  add_executable(${name} ${ARG_SOURCES})
  target_link_libraries(${name} PRIVATE ${ARG_LIBRARIES} arhost-test-support)
  set_target_properties(${name} PROPERTIES RUNTIME_OUTPUT_DIRECTORY ${CMAKE_BINARY_DIR}/tests)
  target_compile_options(${name} PRIVATE ${ARHOST_TEST_OPTIONS})
  target_precompile_headers(${name} REUSE_FROM arhost-test-headers)
  if(ARG_DEPENDS)
    add_dependencies(${name} ${ARG_DEPENDS})
  endif()
endfunction()

# arhost_add_test(name SOURCES … [LIBRARIES …] [LABELS …] [TIMEOUT s] [DEPENDS targets…] [SERIAL] [STATISTICAL filter]
# [EXHAUSTIVE [filter]]): a GoogleTest program; each of its tests is a CTest test. For each label, the target `<label>-tests`
# builds all programs that have it. TIMEOUT: 120 by default; see arhost_scale_timeout. SERIAL: while one of these tests
# runs, CTest runs no other. STATISTICAL: these tests measure over many samples, check all values or repeat others;
# sanitizers omit them, because other tests execute the same code. EXHAUSTIVE: these tests, or those of instantiations
# named `Exhaustive`, have the label `exhaustive` and ten times the timeout, and sanitizers omit them, too.
function(arhost_add_test name)
  cmake_parse_arguments(ARG "SERIAL" "TIMEOUT;STATISTICAL" "SOURCES;LIBRARIES;LABELS;DEPENDS;EXHAUSTIVE" ${ARGN})
  if("EXHAUSTIVE" IN_LIST ARG_KEYWORDS_MISSING_VALUES)
    set(ARG_EXHAUSTIVE "Exhaustive/*")
  endif()
  if(NOT ARG_TIMEOUT)
    set(ARG_TIMEOUT 120)
  endif()
  arhost_scale_timeout(ARG_TIMEOUT)
  arhost_add_test_program(${name} SOURCES ${ARG_SOURCES} LIBRARIES ${ARG_LIBRARIES} DEPENDS ${ARG_DEPENDS})
  foreach(label ${ARG_LABELS})
    if(NOT TARGET ${label}-tests)
      add_custom_target(${label}-tests)
    endif()
    add_dependencies(${label}-tests ${name})
  endforeach()
  if(ARHOST_SANITIZE AND "slow" IN_LIST ARG_LABELS)
    set_target_properties(${name} PROPERTIES EXCLUDE_FROM_ALL ON) # never run under sanitizers
    return()
  endif()
  set(omitted ${ARG_EXHAUSTIVE})
  if(ARHOST_SANITIZE)
    list(APPEND omitted ${ARG_STATISTICAL})
  endif()
  if(omitted)
    list(JOIN omitted ":" omitted)
    set(per_push TEST_FILTER "-${omitted}")
  endif()
  # LeakSanitizer may crash while scanning thread-locals of libraries loaded with dlopen, such as the image module's.
  set(lsan_options suppressions=${CMAKE_SOURCE_DIR}/tests/lsan.supp:print_suppressions=0:intercept_tls_get_addr=0)
  gtest_discover_tests(${name} DISCOVERY_MODE PRE_TEST ${per_push}
                       PROPERTIES TIMEOUT ${ARG_TIMEOUT} RUN_SERIAL ${ARG_SERIAL}
                       ENVIRONMENT "LSAN_OPTIONS=${lsan_options}"
                       LABELS "${ARG_LABELS}")
  if(ARG_EXHAUSTIVE AND NOT ARHOST_SANITIZE)
    math(EXPR exhaustive_timeout "10 * ${ARG_TIMEOUT}")
    gtest_discover_tests(${name} DISCOVERY_MODE PRE_TEST TEST_FILTER "${ARG_EXHAUSTIVE}"
                         PROPERTIES TIMEOUT ${exhaustive_timeout} LABELS exhaustive)
  endif()
endfunction()

# arhost_add_vm_test(name target [MODULES "name parameter=value…" …] [ARGUMENTS …] [EXHAUSTIVE]): runs a test program in
# a virtual machine with a stock kernel. Skipped (exit status 77) if QEMU or the kernel is missing.
function(arhost_add_vm_test name target)
  cmake_parse_arguments(ARG "EXHAUSTIVE" "" "MODULES;ARGUMENTS" ${ARGN})
  set(labels vm)
  set(timeout 300)
  if(ARG_EXHAUSTIVE)
    list(APPEND labels exhaustive)
    set(timeout 1800)
  endif()
  arhost_scale_timeout(timeout)
  set(modules)
  foreach(module ${ARG_MODULES})
    list(APPEND modules -m ${module})
  endforeach()
  add_test(NAME ${name} COMMAND ${CMAKE_SOURCE_DIR}/tools/vm/run-in-vm ${modules} $<TARGET_FILE:${target}> ${ARG_ARGUMENTS})
  set_tests_properties(${name} PROPERTIES LABELS "${labels}" TIMEOUT ${timeout} SKIP_RETURN_CODE 77
                                          ENVIRONMENT ARHOST_VM_TIMEOUT=${timeout})
endfunction()
