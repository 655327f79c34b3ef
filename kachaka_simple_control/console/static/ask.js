// Copyright 2026 kachaka_simple_control contributors, licensed under the Apache License 2.0.
/** The dialog that asks whether the floor is free. It has a STOP of its own: the rest is inert. */

import {byId, setText} from './dom.js';

/** Asks one question at a time. */
export class FloorQuestion {
  constructor() {
    this.dialog = byId('ask');
  }

  /**
   * Ask, and wait for the answer. Escape and Cancel mean no.
   * @param {{subject: string, needs: string, area: string, more: string, confirm: string}} texts
   * @returns {Promise<boolean>}
   */
  ask({subject, needs, area, more, confirm}) {
    if (this.dialog.open) return Promise.resolve(false);
    setText(byId('ask-motion'), subject);
    setText(byId('ask-needs'), needs);
    setText(byId('ask-area'), area);
    byId('ask-area').hidden = area === '';
    setText(byId('ask-more'), more);
    setText(byId('ask-run'), confirm);
    this.dialog.returnValue = 'cancel';
    this.dialog.showModal();
    return new Promise(resolve => {
      this.dialog.addEventListener(
        'close', () => resolve(this.dialog.returnValue === 'run'), {once: true});
    });
  }

  /** Close the dialog without an agreement. */
  cancel() {
    if (this.dialog.open) this.dialog.close('cancel');
  }
}
