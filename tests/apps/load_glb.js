// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// Loads the GLB file that the page names with three.js, draws it, and writes into the page what it found, as JSON.
import * as THREE from 'three';
import { GLTFLoader } from 'three/addons/loaders/GLTFLoader.js';

globalThis.createImageBitmap = undefined; // three.js then loads textures by <img>, for which Chromium's virtual clock waits

const width = 480, height = 600;

function read(url) {
    return new Promise((resolve, reject) => {
        const request = new XMLHttpRequest(); // fetch() takes no file: address
        request.open('GET', url);
        request.responseType = 'arraybuffer';
        request.onload = () => resolve(request.response);
        request.onerror = () => reject(new Error(`cannot read ${url}`));
        request.send();
    });
}

// How much of the picture the head covers, and in how many colours.
function draw(scene, mesh) {
    const box = new THREE.Box3().setFromObject(mesh);
    const center = box.getCenter(new THREE.Vector3());
    const size = box.getSize(new THREE.Vector3());
    const half = 0.55 * Math.max(size.y, size.x * height / width);
    const camera = new THREE.OrthographicCamera(-half * width / height, half * width / height, half, -half, 0.01, 10);
    camera.position.copy(center).add(new THREE.Vector3(0, 0, 2));
    const renderer = new THREE.WebGLRenderer({ preserveDrawingBuffer: true });
    renderer.setSize(width, height);
    renderer.setClearColor(0xffffff);
    scene.add(new THREE.HemisphereLight(0xffffff, 0x888888, 3));
    renderer.render(scene, camera);
    document.body.prepend(renderer.domElement);
    const gl = renderer.getContext();
    const pixels = new Uint8Array(4 * width * height);
    gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
    const colors = new Set();
    let covered = 0;
    for (let i = 0; i < pixels.length; i += 4) {
        const color = pixels[i] << 16 | pixels[i + 1] << 8 | pixels[i + 2];
        covered += color !== 0xffffff;
        colors.add(color);
    }
    return { covered: covered / (width * height), colors: colors.size };
}

// Where the face looks (z of model space) at a time of the animation.
function direction(gltf, mesh, time) {
    const mixer = new THREE.AnimationMixer(gltf.scene);
    mixer.clipAction(gltf.animations[0]).setLoop(THREE.LoopOnce).play();
    mixer.setTime(time);
    gltf.scene.updateMatrixWorld(true);
    return mesh.getWorldDirection(new THREE.Vector3()).toArray();
}

const found = {};
try {
    const gltf = await new GLTFLoader().parseAsync(await read(document.body.dataset.glb), '');
    const meshes = [];
    gltf.scene.traverse(object => object.isMesh && meshes.push(object));
    const mesh = meshes[0];
    found.meshes = meshes.length;
    found.vertices = mesh.geometry.attributes.position.count;
    found.targets = Object.keys(mesh.morphTargetDictionary ?? {});
    found.weights = mesh.morphTargetInfluences ?? [];
    found.animations = gltf.animations.length;
    if (gltf.animations.length > 0) {
        const clip = gltf.animations[0];
        found.duration = clip.duration;
        found.directions = [direction(gltf, mesh, 0), direction(gltf, mesh, clip.duration - 1e-4)];
    }
    Object.assign(found, draw(gltf.scene, mesh));
} catch (error) {
    found.error = String(error);
}
document.getElementById('found').textContent = JSON.stringify(found);
