// SPDX-License-Identifier: Apache-2.0
//
// Runs a test once for each instruction set supported by this machine and build.
#pragma once

#include <gtest/gtest.h>
#include <hwy/highway.h>

#include <string>

namespace arhost::test {

template <class Test> void on_each_instruction_set(const Test &test) {
    for (const std::int64_t target : hwy::SupportedAndGeneratedTargets()) {
        SCOPED_TRACE(std::string("instruction set ") + hwy::TargetName(target));
        hwy::SetSupportedTargetsForTest(target);
        hwy::GetChosenTarget().DeInit();
        test();
        if (testing::Test::HasFailure())
            break;
    }
    hwy::SetSupportedTargetsForTest(0);
    hwy::GetChosenTarget().DeInit();
}

} // namespace arhost::test
