// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// What a report page does itself: tabs, the switch between picture and overlay, and starting each viewer when its
// section is first shown.
'use strict';

window.addEventListener('error', (event) => {
  document.documentElement.dataset.error = event.message || 'error';
});

function startViewers(root) {
  for (const container of root.querySelectorAll('[data-face]')) {
    if (container.dataset.viewer || container.offsetParent === null) continue;
    container.dataset.viewer = 'starting';
    try {
      createViewer(container, JSON.parse(document.getElementById(container.dataset.face).textContent));
    } catch (error) {
      container.dataset.viewer = 'error';
      document.documentElement.dataset.error = String(error);
      container.textContent = 'The 3D view could not be started: ' + error.message;
    }
  }
}

for (const figure of document.querySelectorAll('[data-switch]')) {
  const buttons = figure.querySelectorAll('button[data-show]');
  const pictures = figure.querySelectorAll('img[data-picture]');
  for (const button of buttons) {
    button.addEventListener('click', () => {
      for (const other of buttons) other.setAttribute('aria-pressed', String(other === button));
      for (const picture of pictures) picture.hidden = picture.dataset.picture !== button.dataset.show;
    });
  }
}

const tabs = [...document.querySelectorAll('[role=tab]')];
function selectTab(chosen) {
  for (const tab of tabs) {
    tab.setAttribute('aria-selected', String(tab === chosen));
    tab.tabIndex = tab === chosen ? 0 : -1;
    document.getElementById(tab.getAttribute('aria-controls')).hidden = tab !== chosen;
  }
  startViewers(document);
}
tabs.forEach((tab, i) => {
  tab.addEventListener('click', () => selectTab(tab));
  tab.addEventListener('keydown', (event) => {
    const step = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
    if (!step) return;
    const next = tabs[(i + step + tabs.length) % tabs.length];
    next.focus();
    selectTab(next);
  });
});
if (tabs.length > 0) selectTab(tabs[0]); else startViewers(document);
