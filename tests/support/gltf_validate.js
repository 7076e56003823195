// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// Prints the issues that the Khronos glTF validator finds in a file, and the number of errors and warnings:
//   node gltf_validate.js FOLDER_OF_NODE_MODULES FILE
const fs = require('fs');
const path = require('path');
const validator = require(path.join(process.argv[2], 'gltf-validator'));

validator.validateBytes(new Uint8Array(fs.readFileSync(process.argv[3]))).then(
    report => {
        for (const issue of report.issues.messages) {
            console.log(`${issue.severity} ${issue.code} ${issue.pointer} ${issue.message}`);
        }
        console.log(`errors ${report.issues.numErrors} warnings ${report.issues.numWarnings}`);
    },
    error => {
        console.log(`failed: ${error}`);
        process.exit(1);
    });
